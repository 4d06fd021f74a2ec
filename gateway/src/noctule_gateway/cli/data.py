"""The commands ``repair``, ``check`` and ``backup``: the gateway's data by hand."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from noctule_gateway.cli.failing import failing_in_words

if TYPE_CHECKING:
    from noctule_gateway.audit.look import AuditLook
    from noctule_gateway.log.look import Look

Data = Annotated[Path, typer.Argument(metavar="DATA", help="The data folder of a gateway, which may be running.")]


def repair(
    data: Annotated[Path, typer.Argument(metavar="DATA", help="The data folder of a gateway that is stopped.")],
    unit: Annotated[
        list[str] | None,
        typer.Option(metavar="UNIT", help="Set this unit's log aside, damaged or not; give more for several."),
    ] = None,
) -> None:
    """Set damaged logs aside, whole, into DATA/set-aside; the gateway then begins new ones."""
    from noctule_gateway.log.repair import repair as repair_logs

    with failing_in_words():
        repairs = repair_logs(data, list(dict.fromkeys(unit or [])))
    for each in repairs:
        typer.echo(str(each))


def check(data: Data) -> None:
    """Read every record of every log and say what was damaged or altered; exit status 1 if so. Changes nothing."""
    from noctule.progress import progress
    from noctule_gateway.audit.look import look_at_audit
    from noctule_gateway.log.look import look_at_all

    with failing_in_words():
        with progress() as shown:
            looks = [*look_at_all(data, shown.at), *look_at_audit(data)]
        _tell(looks)


def backup(
    data: Data,
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The folder of the copy; it must not be there yet.")],
) -> None:
    """Copy every log into OUT, each as it is at one moment, and check the copies; exit status 1 if one is damaged."""
    from noctule.backup import copy_databases, whole_or_nothing
    from noctule.progress import progress
    from noctule_gateway.audit.look import copy_audit, look_at_audit
    from noctule_gateway.log.head_file import mark_copy
    from noctule_gateway.log.log_files import head_path
    from noctule_gateway.log.look import look_at_all

    with failing_in_words():
        with whole_or_nothing(out), progress() as shown:
            for copy in copy_databases(data, out, shown.at):
                mark_copy(head_path(copy))
            copy_audit(data, out)
            looks = [*look_at_all(out, shown.at), *look_at_audit(out)]
        _tell(looks)


def _tell(looks: "list[Look | AuditLook]") -> None:
    for each in looks:
        typer.echo(str(each))
    if not all(each.is_sound for each in looks):
        raise typer.Exit(1)
