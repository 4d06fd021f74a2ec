"""The command noctule."""

from typing import NoReturn

from noctule.starting import start


def program() -> NoReturn:
    """The whole process."""
    start("noctule.cli", "app")


if __name__ == "__main__":
    program()
