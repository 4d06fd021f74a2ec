"""Noctule maps rooms by ultrasound; this package is the contract that its parts and any extra service share.

with noctule.Client("paper-room") as client:
    client.on_contour(lambda contour: print(len(contour.walls), "walls"))
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from noctule.errors import (
    BusError,
    KeyFormatError,
    NoctuleError,
    NotServedError,
    SilenceError,
    SiteFileError,
    SurveyError,
)

if TYPE_CHECKING:
    from noctule.async_client import AsyncClient
    from noctule.async_log_follower import AsyncLogFollower
    from noctule.client import Client
    from noctule.log_follower import LogFollower

__all__ = [
    "AsyncClient",
    "AsyncLogFollower",
    "BusError",
    "Client",
    "KeyFormatError",
    "LogFollower",
    "NoctuleError",
    "NotServedError",
    "SilenceError",
    "SiteFileError",
    "SurveyError",
]

_ON_THE_BUS = {
    "AsyncClient": "noctule.async_client",
    "AsyncLogFollower": "noctule.async_log_follower",
    "Client": "noctule.client",
    "LogFollower": "noctule.log_follower",
}


def __getattr__(name: str) -> Any:
    """What needs the bus is loaded when it is first asked for: who reads files of sweeps does not wait for Zenoh."""
    if name not in _ON_THE_BUS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_ON_THE_BUS[name]), name)
