"""Whether this page can show what mappers draw: with the Rerun of this relay, and in the recording that it opens."""

import json
from collections.abc import Iterable
from contextlib import closing
from http.client import HTTPConnection, HTTPException

from noctule import rerun_paths
from noctule.messages_pb2 import ServiceStatus
from noctule_viewer.page import ALIVE

_ANSWER_WITHIN_S = 2.0
_LONGEST_ANSWER = 1000  # bytes


def trouble(own: str, services: Iterable[ServiceStatus]) -> str:
    """Who has another version than ``own``, as ``0.41.0``, and what to do; empty where nobody has.

    Rerun's versions differ in what they read where the second number differs.
    """
    drawing = [each for each in services if each.role == "mapper" and each.rerun]
    others = [f"{each.name} draws with {each.rerun}" for each in drawing if _line(each.rerun) != _line(own)]
    if not others:
        return ""
    return f"{', '.join(others)}, and this relay is Rerun {own}: install one release of Noctule on all hosts"


def of_native_viewer(own: str, relay: str | None) -> str:
    """What a native viewer of version ``own`` says of the ``relay``'s, None where that could not be asked for."""
    if relay is None:
        return "the relay's version of Rerun could not be asked for: see that its page is reached too (--web-port)"
    if _line(relay) == _line(own):
        return ""
    return f"this viewer is Rerun {own}, and the relay is {relay}: install the relay's release of Noctule here"


def elsewhere(own: str, services: Iterable[ServiceStatus]) -> str:
    """Who draws into another recording than ``own``, which this page shows, and what to do; empty where nobody does."""
    drawing = [each for each in services if each.role == "mapper" and each.rerun_recording]
    names = [each.name for each in drawing if each.rerun_recording != own]
    if not names:
        return ""
    if own == rerun_paths.ALL_SITES:
        why = f"this page shows several sites: end its --rerun with {rerun_paths.SEVERAL_SITES}"
    else:
        why = f"this page shows one site: take {rerun_paths.SEVERAL_SITES} off its --rerun"
    return f"what {', '.join(names)} draws is not seen here, because {why}"


def ask(host: str, web_port: int) -> str | None:
    """Which Rerun the relay behind the page at ``host`` is; None where nothing answers that knows."""
    with closing(HTTPConnection(host, web_port, timeout=_ANSWER_WITHIN_S)) as page:
        try:
            page.request("GET", ALIVE)
            told = json.loads(page.getresponse().read(_LONGEST_ANSWER))
        except (OSError, HTTPException, ValueError, RecursionError):
            return None
    relay = told.get("rerun") if isinstance(told, dict) else None
    return relay if isinstance(relay, str) else None


def _line(version: str) -> list[str]:
    return version.split(".")[:2]
