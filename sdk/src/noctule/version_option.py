"""The option --version that every program has. It needs typer, which the programs' packages bring."""

import typer


def version_option(distribution: str) -> object:
    """For ``Annotated[bool, ...]`` in the callback of a typer application: print name and version, and end."""

    def show(wanted: bool) -> None:
        if wanted:
            from importlib import metadata  # which loads a parser of e-mail

            typer.echo(f"{distribution} {metadata.version(distribution)}")
            raise typer.Exit

    return typer.Option("--version", callback=show, is_eager=True, help="Print the version and end.")
