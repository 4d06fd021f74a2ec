"""Whether those who draw have the Rerun of this relay: another version may draw what viewers here can't read."""

from collections.abc import Iterable

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


def _line(version: str) -> list[str]:
    return version.split(".")[:2]
