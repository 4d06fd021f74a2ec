"""The rooms of the demo. Each has a site file in sites/, as an operator would write it, by the simulator's name."""

import re
import tomllib
from pathlib import Path

USUAL = "paper"
_SITES = Path(__file__).with_name("sites")
_UNIT_ADDRESS = re.compile(r"socket://127\.0\.0\.1:(\d+)")
_FIRST_PORT = 7101  # in the files


def names() -> list[str]:
    """All rooms, in the order of the alphabet."""
    return sorted(path.stem for path in _SITES.glob("*.toml"))


def site_file(room: str, unit_port: int) -> str:
    """The room's site file, with its units at that port of this machine and the ones after it."""

    def moved(address: re.Match[str]) -> str:
        return f"socket://127.0.0.1:{int(address[1]) - _FIRST_PORT + unit_port}"

    return _UNIT_ADDRESS.sub(moved, _text(room))


def site_name(room: str) -> str:
    """The site's name on the bus."""
    return tomllib.loads(_text(room))["site"]


def units(room: str) -> int:
    """How many units the room has."""
    return len(tomllib.loads(_text(room))["unit"])


def _text(room: str) -> str:
    return (_SITES / f"{room}.toml").read_text()
