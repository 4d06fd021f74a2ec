"""The command noctule-viewer."""

from typing import NoReturn

from noctule.starting import start


def program() -> NoReturn:
    """The whole process."""
    start("noctule_viewer.cli", "app")


if __name__ == "__main__":
    program()
