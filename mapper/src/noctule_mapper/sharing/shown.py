"""What Prometheus reads of a mapper that shares sites: its own state, and that of each site that it maps now.

The sites' mappers are other processes; their figures are those that they publish.
"""

from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version

import zenoh
from google.protobuf.message import Message

from noctule import bounds, keys
from noctule.errors import BoundsError
from noctule.messages_pb2 import Contour, ServiceStatus

ROLE = "share"


class _SiteShown:
    """The last status and contour that ``name`` has published of ``site``."""

    def __init__(self, session: zenoh.Session, site: str, name: str) -> None:
        self._name = name
        self._latest: dict[type[Message], bytes] = {}
        self._subscribers = [
            session.declare_subscriber(key, lambda sample, kind=kind: self._note(kind, sample))
            for key, kind in ((keys.service_status(site, name), ServiceStatus), (keys.contour(site), Contour))
        ]

    def messages(self) -> list[ServiceStatus | Contour]:
        found = []
        for kind in (ServiceStatus, Contour):
            try:
                message = bounds.decode(kind, self._latest[kind])
            except (KeyError, BoundsError):
                continue  # none yet, or none of ours
            if isinstance(message, ServiceStatus) or message.mapper == self._name:
                found.append(message)
        return found

    def close(self) -> None:
        for subscriber in self._subscribers:
            subscriber.undeclare()

    def _note(self, kind: type[Message], sample: zenoh.Sample) -> None:
        self._latest[kind] = sample.payload.to_bytes()  # decoded when somebody asks


class Shown:
    """The figures of the mapper ``name``; note() keeps them, from the main loop."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._sites: dict[str, _SiteShown] = {}
        self._counters: dict[str, int] = {}
        self._pids: Mapping[str, int] = {}

    def note(self, counters: Mapping[str, int], pids: Mapping[str, int]) -> None:
        """What the process counts, and the processes of the sites that it maps now."""
        self._counters, self._pids = dict(counters), dict(pids)

    def follow(self, session: zenoh.Session, sites: Iterable[str]) -> None:
        """Show these sites and no others."""
        wanted = set(sites)
        for site in self._sites.keys() - wanted:
            self._drop(site)
        for site in wanted - self._sites.keys():
            self._sites = self._sites | {site: _SiteShown(session, site, self._name)}

    def statuses(self) -> Sequence[ServiceStatus | Contour]:
        """What is known now. From any thread, never waiting."""
        own = ServiceStatus(name=self._name, role=ROLE, version=version("noctule-mapper"), counters=self._counters)
        own.time.GetCurrentTime()
        return [own, *(message for shown in self._sites.values() for message in shown.messages())]

    def pids(self) -> Mapping[str, int]:
        """Site to process. From any thread."""
        return self._pids

    def close(self) -> None:
        """Follow no site."""
        for site in list(self._sites):
            self._drop(site)

    def _drop(self, site: str) -> None:
        dropped = self._sites[site]
        # A scrape may be reading the table: it is replaced, never changed.
        self._sites = {other: shown for other, shown in self._sites.items() if other != site}
        dropped.close()
