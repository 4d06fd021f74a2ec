"""The commands that ask one question: a unit's log, a message's schema."""

import difflib
from typing import TYPE_CHECKING, Annotated

import typer

from noctule import keys
from noctule.cli.options import DEFAULT_CONNECT, Connect, SiteName, UnitName
from noctule.errors import BusError
from noctule.program_options import Tls

if TYPE_CHECKING:
    import zenoh


def log(
    site: SiteName,
    unit: UnitName,
    first: Annotated[int, typer.Option("--from", metavar="N", help="The first log sequence.", min=0)] = 1,
    connect: Connect = DEFAULT_CONNECT,
    tls: Tls = None,
) -> None:
    """Print a unit's log as JSON lines of Sweep."""
    from noctule import survey
    from noctule.cli.joining import joined

    with joined(site, connect, tls) as client:
        records = client.log(unit, first, max=1)
        if records is not None and first > max(records.head, 1):
            raise BusError(f"unit {unit!r} has no sweep {first} yet: its log ends at {records.head}")
        for sweep in client.history(unit, first):
            typer.echo(survey.to_json(sweep))


def schema(
    message: Annotated[
        str | None, typer.Argument(metavar="MESSAGE", help="As noctule.v1.Sweep; all if left out.")
    ] = None,
    connect: Connect = DEFAULT_CONNECT,
    tls: Tls = None,
) -> None:
    """Print the schemas that the bus gives out: the messages' names, or one message's fields."""
    from google.protobuf.descriptor_pb2 import FileDescriptorSet

    from noctule import bus
    from noctule.cli.joining import SHORT_PATIENCE_S

    with bus.closing(bus.open_session(connect, patience_s=SHORT_PATIENCE_S, tls_folder=tls)) as session:
        replies = [reply.ok for reply in session.get(keys.schema(message or keys.ANY)) if reply.ok is not None]
        if not replies:
            raise BusError(_no_schema(session, message))
    if message is None:
        for name in sorted(set(map(_name, replies))):
            typer.echo(name)
        return
    for file in FileDescriptorSet.FromString(replies[0].payload.to_bytes()).file:
        for described in file.message_type:
            if f"{file.package}.{described.name}" == message:
                typer.echo(str(described).rstrip())


def _no_schema(session: "zenoh.Session", message: str | None) -> str:
    known = [_name(reply.ok) for reply in session.get(keys.schema(keys.ANY)) if reply.ok is not None]
    if not known:
        return f"nobody on the bus knows the schema of {message or 'any message'}: start a gateway or mapper"
    # Most leave out the package, and some letters.
    near = difflib.get_close_matches(message or "", [*known, *(name.rsplit(".", 1)[-1] for name in known)], n=1)
    meant = next((name for name in known if near and name.endswith(near[0])), "")
    return f"no message is named {message}: " + (f"did you mean {meant}?" if meant else f"there is {', '.join(known)}")


def _name(reply: "zenoh.Sample") -> str:
    return str(reply.key_expr).rsplit("/", 1)[-1]
