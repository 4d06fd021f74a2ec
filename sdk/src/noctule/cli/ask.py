"""The commands that ask one question: a unit's log, a message's schema."""

from typing import Annotated

import typer
from google.protobuf.descriptor_pb2 import FileDescriptorSet

from noctule import bus, keys, survey
from noctule.cli.joining import DEFAULT_CONNECT, SHORT_PATIENCE_S, Connect, SiteName, Tls, UnitName, joined, may_read
from noctule.errors import BusError, NotServedError


def log(
    site: SiteName,
    unit: UnitName,
    first: Annotated[int, typer.Option("--from", metavar="N", help="The first log sequence.", min=0)] = 1,
    connect: Connect = DEFAULT_CONNECT,
    tls: Tls = None,
) -> None:
    """Print a unit's log as JSON lines of Sweep."""
    with joined(site, connect, tls) as client:
        try:
            for sweep in client.history(unit, first):
                typer.echo(survey.to_json(sweep))
        except NotServedError as error:
            raise NotServedError(f"{error}.{may_read(tls)}") from error


def schema(
    message: Annotated[
        str | None, typer.Argument(metavar="[MESSAGE]", help="noctule.v1.Sweep; all if left out.")
    ] = None,
    connect: Connect = DEFAULT_CONNECT,
    tls: Tls = None,
) -> None:
    """Print the schemas that the bus gives out: the messages' names, or one message's fields."""
    with bus.open_session(connect, patience_s=SHORT_PATIENCE_S, tls_folder=tls) as session:
        replies = [reply.ok for reply in session.get(keys.schema(message or keys.ANY)) if reply.ok is not None]
    if not replies:
        raise BusError(f"nobody on the bus knows the schema of {message or 'any message'}: start a gateway or mapper")
    if message is None:
        for name in sorted({str(reply.key_expr).rsplit("/", 1)[-1] for reply in replies}):
            typer.echo(name)
        return
    for file in FileDescriptorSet.FromString(replies[0].payload.to_bytes()).file:
        for described in file.message_type:
            if f"{file.package}.{described.name}" == message:
                typer.echo(str(described).rstrip())
