"""The options that several programs have. They need typer, which the programs' packages bring."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from noctule import endpoints, keys, logs, tls
from noctule.errors import BusConfigError, NoctuleError
from noctule.wanted import wanted


class Commands(TyperGroup):
    """The commands of a program. Where a value is wrong, they say what it may be, also where typer's words do not."""

    def invoke(self, ctx: typer.Context) -> Any:
        try:
            return super().invoke(ctx)
        except typer.BadParameter as error:
            if findings := getattr(error.__cause__, "errors", None):  # pydantic's, which this need not load
                error.message = _mistake(findings()[0])
            raise


def _mistake(error: Any) -> str:
    if error["type"] == "value_error":
        return wanted(error)
    return f"it is {str(error['input'])!r}: {wanted(error)}"


def checked(check: Callable[[Any], object]) -> Callable[[Any], Any]:
    """The callback of an option or an argument, or of a list of them: a value for which ``check`` raises NoctuleError
    is a mistake in the command line, so the program ends with status 2 before it begins anything.
    """

    def look(value: Any) -> Any:
        for each in value if isinstance(value, list) else [value]:
            try:
                if each is not None:
                    check(each)
            except NoctuleError as error:
                raise typer.BadParameter(str(error)) from error
        return value

    return look


def suffixed(*suffixes: str) -> Callable[[Any], Any]:
    """The callback of an option for a file that is written as one of ``suffixes`` says: the name of another kind is a
    mistake. One without a suffix, such as that of a device, says nothing.
    """

    def look(file: Path) -> None:
        if file.suffix not in ("", *suffixes):
            named = " or ".join(str(file.with_suffix(suffix)) for suffix in suffixes)
            raise NoctuleError(f"what is written is no {file.suffix} file: name it {named}")

    return checked(look)


def _endpoint(text: str) -> None:
    if fault := endpoints.fault(text):
        raise BusConfigError(fault)


def _metrics(text: str) -> None:
    from noctule.metrics_server import address  # which loads Prometheus

    address(text)


ENDPOINT = checked(_endpoint)
NAME = checked(lambda text: keys.name(text, "the name"))
SITE = checked(lambda text: text.endswith(".toml") or keys.name(text, "the name"))  # or its site file

Tls = Annotated[
    Path | None,
    typer.Option(
        "--tls",
        envvar=tls.FOLDER_VARIABLE,
        metavar="FOLDER",
        help="Certificate and key: a folder that noctule-deploy render made. It also names the routers.",
    ),
]
Metrics = Annotated[
    str | None,
    typer.Option("--metrics", metavar="HOST:PORT", callback=checked(_metrics), help="Serve Prometheus metrics here."),
]
Format = Annotated[
    logs.LogFormat,
    typer.Option("--log-format", envvar=logs.FORMAT_VARIABLE, help="The log as text, or as JSON lines."),
]


def check_folders(*files: Path | None) -> None:
    """Call it before anything is computed. Raises NoctuleError if the folder of one of ``files`` does not exist."""
    for file in files:
        if file is not None and not file.absolute().parent.is_dir():
            raise NoctuleError(f"there is no folder {file.absolute().parent}: make it, or name another")


def version_option(distribution: str) -> object:
    """For ``Annotated[bool, ...]`` in the callback of a typer application: print name and version, and end."""

    def show(wanted: bool) -> None:
        if wanted:
            from importlib import metadata  # which loads a parser of e-mail

            typer.echo(f"{distribution} {metadata.version(distribution)}")
            raise typer.Exit

    return typer.Option("--version", callback=show, is_eager=True, help="Print the version and end.")
