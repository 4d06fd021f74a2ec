"""What ``rpc`` does: have a unit carry out a command, and print its reply."""

from collections.abc import Mapping
from typing import Any

import typer
from rich.console import Console
from rich.text import Text

from noctule import survey
from noctule.cli import replies
from noctule.cli.asked import Asked
from noctule.cli.joining import joined
from noctule.client import Client
from noctule.errors import BusError
from noctule.messages_pb2 import CommandReply, CommandRequest, UnitStatus
from noctule.plain_text import plain


def ask(asked: Asked, fields: Mapping[str, Any]) -> None:
    """Ask it with ``fields`` of the request. Raises BusError if it was not done."""
    with joined(asked.of.site, asked.connect, asked.tls) as client:
        _ask(client, asked, fields)


def ask_showing_progress(asked: Asked, fields: Mapping[str, Any]) -> None:
    """The same; a terminal shows meanwhile what the unit's status says."""
    unit = asked.of.unit
    with (
        joined(asked.of.site, asked.connect, asked.tls) as client,
        Console(stderr=True).status(f"{unit}: updating") as shown,
    ):

        def show(status: UnitStatus) -> None:
            if status.unit == unit:
                shown.update(Text(plain(f"{unit}: {status.detail}")))

        client.on_unit_status(show)
        _ask(client, asked, fields)


def _ask(client: Client, asked: Asked, fields: Mapping[str, Any]) -> None:
    unit, command = asked.of.unit, asked.command
    reply: CommandReply = client.command(unit, command, CommandRequest(**fields), asked.timeout_s)
    if not reply.done:
        raise BusError(f"{command} was not done by unit {unit!r}: {reply.error}")
    shown = [survey.to_json(reply)] if asked.of.json else map(plain, replies.lines(unit, command, reply))
    typer.echo("\n".join(shown))
