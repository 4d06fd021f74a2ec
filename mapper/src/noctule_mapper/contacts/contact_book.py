"""The contacts of all sweeps as they come and go: a sweep is matched only with a bounded number of sweeps near it.

Sweeps from one place hear the same and err alike, so a place has one vote on a reading. Its newest sweep casts it, and
takes it over from an older one on the newest sweeps of the places about. A vote of one reading for another depends on
the two alone, so it can be cast once more and taken off.
"""

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from noctule_mapper.config import ContactConfig
from noctule_mapper.contacts.voting import Contacts, contacts, join_contacts, votes
from noctule_mapper.readings.echoes import Echoes, join

Identity = tuple[str, int]


@dataclass
class _Place:
    """Where its first sweep was made, and its sweeps as they came."""

    number: int
    x_m: float
    y_m: float
    sweeps: list[Identity] = field(default_factory=list)


@dataclass
class _Page:
    """One sweep's echoes, the votes that they have got, what these say, the sweeps that gave them, by the number of
    their place, and the sweeps that it gives its own to.
    """

    echoes: Echoes
    x_m: float
    y_m: float
    place: _Place
    votes: np.ndarray
    contacts: Contacts
    voters: dict[int, Identity] = field(default_factory=dict)
    hearers: set[Identity] = field(default_factory=set)


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
        self._places = _Places(config.shortest_baseline_m, config.longest_baseline_m)

    def add(self, identity: Identity, x_m: float, y_m: float, echoes: Echoes) -> ContactChange:
        """Match a new sweep, whose echoes all have (x_m, y_m) for their place, with those near it."""
        place = self._places.enter(identity, x_m, y_m)
        none = self._no_votes(echoes)
        page = _Page(echoes, x_m, y_m, place, none, contacts(echoes, none, self._config))
        near = self._near(page)
        self._pages[identity] = page
        for older in sorted({older for one in near if (older := self._pages[one].voters.get(place.number))}):
            self._unheard(older, [one for one in near if one in self._pages[older].hearers])
        self._heard(identity, near)
        self._hear(identity, near)
        return self._reread([page, *(self._pages[one] for one in near)])

    def remove(self, identity: Identity) -> ContactChange:
        """Take a sweep's votes back and close its page; the sweep before it at its place stands in for it."""
        page = self._pages[identity]
        voters, hearers = list(page.voters.values()), sorted(page.hearers)
        self._unheard(identity, hearers)
        self._hear(identity, [])
        touched = [page, *(self._pages[one] for one in hearers)]
        before = self._places.leave(identity, page.place)
        if before is not None:
            self._heard(before, hearers)
            self._hear(before, voters)
            touched.append(self._pages[before])
        del self._pages[identity]
        return self._reread(touched)

    def exchange(self, identity: Identity, echoes: Echoes) -> tuple[ContactChange, ContactChange]:
        """Give a sweep other echoes, at its place and in its turn; what this does to the old echoes and to the new."""
        page = self._pages[identity]
        voters, hearers = list(page.voters.values()), sorted(page.hearers)
        self._unheard(identity, hearers)
        none = contacts(page.echoes, self._no_votes(page.echoes), self._config)
        gone = ContactChange(page.echoes, page.contacts, none)
        page.echoes, page.contacts = echoes, contacts(echoes, self._no_votes(echoes), self._config)
        self._heard(identity, hearers)
        self._hear(identity, voters)
        return gone, self._reread([page, *(self._pages[one] for one in hearers)])

    def echoes(self, of: Sequence[Identity] | None = None) -> Echoes:
        """The echoes ``of`` some sweeps, or of all as they came."""
        return join([self._pages[identity].echoes for identity in of or self._pages])

    def contacts(self, of: Sequence[Identity] | None = None) -> Contacts:
        """The contacts of these echoes, in their order."""
        return join_contacts([self._pages[identity].contacts for identity in of or self._pages])

    def _hear(self, identity: Identity, voters: Sequence[Identity]) -> None:
        """Give a sweep the votes of ``voters``, each from a place of its own, and no others."""
        page = self._pages[identity]
        for voter in page.voters.values():
            self._pages[voter].hearers.discard(identity)
        page.voters = {self._pages[voter].place.number: voter for voter in voters}
        page.votes = self._no_votes(page.echoes)
        if voters:
            page.votes += votes(page.echoes, join([self._pages[voter].echoes for voter in voters]), self._config)
        for voter in voters:
            self._pages[voter].hearers.add(identity)

    def _heard(self, voter: Identity, hearers: Sequence[Identity]) -> None:
        """Cast a sweep's votes for ``hearers``."""
        self._cast(voter, hearers, 1)
        for hearer in hearers:
            self._pages[hearer].voters[self._pages[voter].place.number] = voter
        self._pages[voter].hearers.update(hearers)

    def _unheard(self, voter: Identity, hearers: Sequence[Identity]) -> None:
        """Take a sweep's votes for ``hearers`` off."""
        self._cast(voter, hearers, -1)
        for hearer in hearers:
            del self._pages[hearer].voters[self._pages[voter].place.number]
        self._pages[voter].hearers.difference_update(hearers)

    def _cast(self, voter: Identity, hearers: Sequence[Identity], sign: int) -> None:
        if not hearers:
            return
        pages = [self._pages[hearer] for hearer in hearers]
        given = votes(join([page.echoes for page in pages]), self._pages[voter].echoes, self._config)
        ends = np.cumsum([len(page.echoes) for page in pages])[:-1]
        for page, share in zip(pages, np.split(given, ends), strict=True):
            page.votes += sign * share

    def _reread(self, pages: Sequence[_Page]) -> ContactChange:
        """Read the votes of ``pages`` again."""
        echoes = join([page.echoes for page in pages])
        before = join_contacts([page.contacts for page in pages])
        after = contacts(echoes, np.concatenate([page.votes for page in pages]), self._config)
        start = 0
        for page in pages:
            page.contacts = after.take(slice(start, start + len(page.echoes)))
            start += len(page.echoes)
        moved = np.any([getattr(before, name) != getattr(after, name) for name in ("direction_rad", "kind")], axis=0)
        return ContactChange(echoes.take(moved), before.take(moved), after.take(moved))

    def _near(self, page: _Page) -> list[Identity]:
        """The newest sweep of each other place within the baselines; where these are too many, an even choice by
        distance.
        """
        found = [place.sweeps[-1] for place in self._places.about(page.x_m, page.y_m) if place is not page.place]
        distance = np.array(
            [math.hypot(self._pages[one].x_m - page.x_m, self._pages[one].y_m - page.y_m) for one in found]
        )
        inside = np.nonzero(
            (distance >= self._config.shortest_baseline_m) & (distance <= self._config.longest_baseline_m)
        )[0]
        inside = inside[np.argsort(distance[inside], kind="stable")]
        if len(inside) > self._config.partners:
            inside = inside[np.linspace(0, len(inside) - 1, self._config.partners).astype(int)]
        return [found[index] for index in inside]

    def _no_votes(self, echoes: Echoes) -> np.ndarray:
        return np.zeros((len(echoes), self._config.direction_bins, self._config.curvature_bins))


class _Places:
    """Places no nearer to one another than ``apart_m``, in districts ``reach_m`` wide."""

    def __init__(self, apart_m: float, reach_m: float) -> None:
        self._apart_m, self._reach_m = apart_m, reach_m
        self._districts: dict[tuple[int, int], list[_Place]] = defaultdict(list)
        self._made = 0

    def enter(self, identity: Identity, x_m: float, y_m: float) -> _Place:
        """The place of a new sweep: one that is there, or a new one."""
        away_m, _, place = min(
            ((math.hypot(place.x_m - x_m, place.y_m - y_m), place.number, place) for place in self.about(x_m, y_m)),
            default=(math.inf, 0, None),
        )
        if place is None or away_m >= self._apart_m:
            self._made += 1
            place = _Place(self._made, x_m, y_m)
            self._districts[self._district(x_m, y_m)].append(place)
        place.sweeps.append(identity)
        return place

    def leave(self, identity: Identity, place: _Place) -> Identity | None:
        """Take a sweep from its place, and a place without sweeps away; returns the sweep before it there, if any."""
        at = place.sweeps.index(identity)
        before = place.sweeps[at - 1] if at else None
        del place.sweeps[at]
        if not place.sweeps:
            district = self._district(place.x_m, place.y_m)
            self._districts[district].remove(place)
            if not self._districts[district]:
                del self._districts[district]
        return before

    def about(self, x_m: float, y_m: float) -> list[_Place]:
        """All places that lie within reach of a position, and some beyond."""
        column, row = self._district(x_m, y_m)
        around = [(column + dx, row + dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1)]
        return [place for district in around for place in self._districts.get(district, ())]

    def _district(self, x_m: float, y_m: float) -> tuple[int, int]:
        return int(x_m // self._reach_m), int(y_m // self._reach_m)
