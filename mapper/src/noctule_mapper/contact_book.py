"""The contacts of all sweeps as they come and go: a sweep is matched only with a bounded number of sweeps near it.

A vote of one reading for another depends on the two alone, so the votes of a sweep that leaves are cast once more and
taken off.
"""

from collections import defaultdict
from dataclasses import dataclass, field

import numpy as np

from noctule_mapper.config import ContactConfig
from noctule_mapper.contacts import Contacts, contacts, join_contacts, votes
from noctule_mapper.echoes import Echoes, join

Identity = tuple[str, int]
_Place = tuple[int, int]


@dataclass
class _Page:
    """One sweep's echoes, the votes that they have got, what these say, and the sweeps that voted."""

    echoes: Echoes
    x_m: float
    y_m: float
    votes: np.ndarray
    contacts: Contacts
    partners: set[Identity] = field(default_factory=set)


@dataclass(frozen=True)
class ContactChange:
    """Contacts that a sweep's coming or going has changed: the echoes with what was known of them before and what is
    known now.
    """

    echoes: Echoes
    before: Contacts
    after: Contacts


class ContactBook:
    """A page for each sweep."""

    def __init__(self, config: ContactConfig) -> None:
        self._config = config
        self._pages: dict[Identity, _Page] = {}
        self._districts: dict[_Place, dict[_Place, list[Identity]]] = defaultdict(dict)

    def add(self, identity: Identity, x_m: float, y_m: float, echoes: Echoes) -> ContactChange:
        """Match a new sweep, whose echoes all have (x_m, y_m) for their place, with those near it."""
        accumulators = np.zeros((len(echoes), self._config.direction_bins, self._config.curvature_bins))
        page = _Page(echoes, x_m, y_m, accumulators, contacts(echoes, accumulators, self._config))
        page.partners = set(self._near(x_m, y_m))
        district, place = self._address(x_m, y_m)
        self._districts[district].setdefault(place, []).append(identity)
        self._pages[identity] = page
        for partner in page.partners:
            self._pages[partner].partners.add(identity)
        return self._vote(identity, 1)

    def remove(self, identity: Identity) -> ContactChange:
        """Take a sweep's votes back and close its page."""
        change = self._vote(identity, -1)
        page = self._pages.pop(identity)
        for partner in page.partners:
            self._pages[partner].partners.discard(identity)
        district, place = self._address(page.x_m, page.y_m)
        self._districts[district][place].remove(identity)
        if not self._districts[district][place]:
            del self._districts[district][place]
        return change

    def echoes(self) -> Echoes:
        """All echoes, sweep after sweep as they came."""
        return join([page.echoes for page in self._pages.values()])

    def contacts(self) -> Contacts:
        """The contacts of all echoes, in the order of ``echoes``."""
        return join_contacts([page.contacts for page in self._pages.values()])

    def _vote(self, identity: Identity, sign: int) -> ContactChange:
        """Let ``identity`` and its partners vote for one another (1), or take those votes off (-1)."""
        page = self._pages[identity]
        partners = [self._pages[partner] for partner in sorted(page.partners)]
        touched = [page, *partners]
        echoes = join([one.echoes for one in touched])
        before = join_contacts([one.contacts for one in touched])
        if partners:
            others = join([one.echoes for one in partners])
            page.votes += sign * votes(page.echoes, others, self._config)
            given = votes(others, page.echoes, self._config)
            ends = np.cumsum([len(one.echoes) for one in partners])[:-1]
            for one, share in zip(partners, np.split(given, ends), strict=True):
                one.votes += sign * share
        after = contacts(echoes, np.concatenate([one.votes for one in touched]), self._config)
        start = 0
        for one in touched:
            one.contacts = after.take(slice(start, start + len(one.echoes)))
            start += len(one.echoes)
        moved = np.any([getattr(before, name) != getattr(after, name) for name in ("direction_rad", "kind")], axis=0)
        return ContactChange(echoes.take(moved), before.take(moved), after.take(moved))

    def _near(self, x_m: float, y_m: float) -> list[Identity]:
        """The newest sweep of each place within the baselines; where these are too many, an even choice by distance."""
        (column, row), _ = self._address(x_m, y_m)
        found = [
            identities[-1]
            for dx in (-1, 0, 1)
            for dy in (-1, 0, 1)
            for identities in self._districts.get((column + dx, row + dy), {}).values()
        ]
        distance = np.array([np.hypot(self._pages[one].x_m - x_m, self._pages[one].y_m - y_m) for one in found])
        inside = np.nonzero(
            (distance >= self._config.shortest_baseline_m) & (distance <= self._config.longest_baseline_m)
        )[0]
        inside = inside[np.argsort(distance[inside], kind="stable")]
        if len(inside) > self._config.partners:
            inside = inside[np.linspace(0, len(inside) - 1, self._config.partners).astype(int)]
        return [found[index] for index in inside]

    def _address(self, x_m: float, y_m: float) -> tuple[_Place, _Place]:
        """District (longest baseline wide) and place (shortest baseline wide) of a position."""
        wide, narrow = self._config.longest_baseline_m, self._config.shortest_baseline_m
        return (int(x_m // wide), int(y_m // wide)), (int(x_m // narrow), int(y_m // narrow))
