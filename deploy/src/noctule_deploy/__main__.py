"""The command noctule-deploy."""

from typing import NoReturn

from noctule.starting import start


def program() -> NoReturn:
    """The whole process."""
    start("noctule_deploy.cli", "main")


if __name__ == "__main__":
    program()
