"""The bus's router as a program of its own: ``router.py ENDPOINT [IDENTITY]``, one of a new identity without it."""

import signal
import sys

import zenoh

from noctule import bus_config


def main() -> None:
    """Route until the process is killed."""
    endpoint, *identity = sys.argv[1:]
    config = bus_config.config([], [endpoint], None)
    if identity:
        config.insert_json5("id", f'"{identity[0]}"')
    with zenoh.open(config):
        signal.pause()


if __name__ == "__main__":
    main()
