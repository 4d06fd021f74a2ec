"""Whether this page can show what mappers draw: with the Rerun of this relay, and in the recording that it opens."""

from collections.abc import Iterable

from noctule import rerun_paths
from noctule.messages_pb2 import ServiceStatus


def trouble(own: str, services: Iterable[ServiceStatus]) -> str:
    """Who has another version than ``own``, as ``0.41.0``, and what to do; empty where nobody has.

    Rerun's versions differ in what they read where the second number differs.
    """
    drawing = [each for each in services if each.role == "mapper" and each.rerun]
    others = [f"{each.name} draws with {each.rerun}" for each in drawing if _line(each.rerun) != _line(own)]
    if not others:
        return ""
    return f"{', '.join(others)}, and this relay is Rerun {own}: install one release of Noctule on all hosts"


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


def _line(version: str) -> list[str]:
    return version.split(".")[:2]
