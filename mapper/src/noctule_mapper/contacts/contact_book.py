"""The contacts of all sweeps as they come and go: a sweep is matched only with a bounded number of sweeps near it.

Sweeps from one place hear the same and err alike, so a place has one vote on a reading. Its newest sweep casts it, and
takes it over from an older one on the newest sweeps of the places about. A vote of one reading for another depends on
the two alone, so it can be cast once more and taken off.

A fine sweep needs no votes: the plateaus of its own pose tell its contacts. It votes for coarse ones as any sweep does.
"""

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from noctule_mapper.config import ContactConfig, RefinementConfig
from noctule_mapper.contacts.plateau_contacts import plateau_contacts, sharing_plateaus, sweeps_together
from noctule_mapper.contacts.voting import Contacts, contacts, join_contacts, votes
from noctule_mapper.readings.echoes import Echoes, join
from noctule_mapper.readings.looks import Looks

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
    their place, and the sweeps that it gives its own to. Of a fine sweep the looks instead, and its votes stay 0.
    """

    echoes: Echoes
    looks: Looks | None
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

    def __init__(self, config: ContactConfig, refinement: RefinementConfig | None = None) -> None:
        self._config = config
        self._refinement = refinement or RefinementConfig()
        self._pages: dict[Identity, _Page] = {}
        self._poses: dict[tuple[float, float], list[Identity]] = {}  # the fine sweeps from each position, as they came
        self._places = _Places(config.shortest_baseline_m, config.longest_baseline_m)

    def add(
        self, identity: Identity, x_m: float, y_m: float, echoes: Echoes, looks: Looks | None = None
    ) -> ContactChange:
        """Match a new sweep, whose echoes all have (x_m, y_m) for their place, with those near it; a fine one comes
        with its ``looks``.
        """
        place = self._places.enter(identity, x_m, y_m)
        none = self._no_votes(echoes)
        page = _Page(echoes, looks, x_m, y_m, place, none, contacts(echoes, none, self._config))
        near = self._near(page)
        self._pages[identity] = page
        for older in sorted({older for one in near if (older := self._pages[one].voters.get(place.number))}):
            self._unheard(older, [one for one in near if one in self._pages[older].hearers])
        self._heard(identity, near)
        self._hear(identity, near)
        if looks is not None:
            at = self._poses.setdefault((x_m, y_m), [])
            at.append(identity)
            return self._reread(near, sharing_plateaus(at, len(at) - 1))
        return self._reread([identity, *near])

    def remove(self, identity: Identity) -> ContactChange:
        """Take a sweep's votes back and close its page; the sweep before it at its place stands in for it."""
        page = self._pages[identity]
        voters, hearers = list(page.voters.values()), sorted(page.hearers)
        self._unheard(identity, hearers)
        self._hear(identity, [])
        touched = [identity, *hearers]
        before = self._places.leave(identity, page.place)
        if before is not None:
            self._heard(before, hearers)
            self._hear(before, voters)
            touched.append(before)
        change = self._reread(touched, self._leave_pose(identity, page))
        del self._pages[identity]
        return change

    def exchange(
        self, identity: Identity, echoes: Echoes, looks: Looks | None = None
    ) -> tuple[ContactChange, ContactChange]:
        """Give a sweep other echoes, and a fine one other looks, at its place and in its turn; what this does to the
        old echoes and to the new.
        """
        page = self._pages[identity]
        voters, hearers = list(page.voters.values()), sorted(page.hearers)
        self._unheard(identity, hearers)
        none = contacts(page.echoes, self._no_votes(page.echoes), self._config)
        gone = ContactChange(page.echoes, page.contacts, none)
        page.echoes, page.contacts = echoes, contacts(echoes, self._no_votes(echoes), self._config)
        self._heard(identity, hearers)
        self._hear(identity, voters)
        if looks is None:
            return gone, self._reread([identity, *hearers])
        page.looks, at = looks, self._poses[page.x_m, page.y_m]
        return gone, self._reread(hearers, sharing_plateaus(at, at.index(identity)))

    def echoes(self, of: Sequence[Identity] | None = None) -> Echoes:
        """The echoes ``of`` some sweeps, or of all as they came."""
        return join([self._pages[identity].echoes for identity in of or self._pages])

    def contacts(self, of: Sequence[Identity] | None = None) -> Contacts:
        """The contacts of these echoes, in their order."""
        return join_contacts([self._pages[identity].contacts for identity in of or self._pages])

    def heard_from_m(self) -> np.ndarray:
        """From where the sweeps that have echoes were made, (sweeps, 2)."""
        at_m = [(page.x_m, page.y_m) for page in self._pages.values() if len(page.echoes)]
        return np.array(at_m).reshape(-1, 2)

    def _hear(self, identity: Identity, voters: Sequence[Identity]) -> None:
        """Give a sweep the votes of ``voters``, each from a place of its own, and no others."""
        page = self._pages[identity]
        for voter in page.voters.values():
            self._pages[voter].hearers.discard(identity)
        page.voters = {self._pages[voter].place.number: voter for voter in voters}
        page.votes = self._no_votes(page.echoes)
        if voters and page.looks is None:
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
        pages = [page for hearer in hearers if (page := self._pages[hearer]).looks is None]
        if not pages:
            return
        given = votes(join([page.echoes for page in pages]), self._pages[voter].echoes, self._config)
        ends = np.cumsum([len(page.echoes) for page in pages])[:-1]
        for page, share in zip(pages, np.split(given, ends), strict=True):
            page.votes += sign * share

    def _leave_pose(self, identity: Identity, page: _Page) -> list[Identity]:
        """Take a sweep, if it is a fine one, from its pose; returns those there that shared plateaus with it."""
        if page.looks is None:
            return []
        page.looks = None  # no plateau tells its contacts any more, and it has no votes
        at = self._poses[page.x_m, page.y_m]
        number = at.index(identity)
        del at[number]
        if not at:
            del self._poses[page.x_m, page.y_m]
        return sharing_plateaus(at, number)

    def _reread(self, voted: Sequence[Identity], fine: Sequence[Identity] = ()) -> ContactChange:
        """Read again the votes of sweeps, fine ones left out, and the plateaus of ``fine`` ones."""
        coarse = [page for one in voted if (page := self._pages[one]).looks is None]
        pages = [*coarse, *(self._pages[one] for one in fine)]
        echoes = join([page.echoes for page in pages])
        before = join_contacts([page.contacts for page in pages])
        after = join_contacts([self._by_votes(coarse), *self._by_plateaus(fine)])
        start = 0
        for page in pages:
            page.contacts = after.take(slice(start, start + len(page.echoes)))
            start += len(page.echoes)
        moved = np.any([getattr(before, name) != getattr(after, name) for name in ("direction_rad", "kind")], axis=0)
        return ContactChange(echoes.take(moved), before.take(moved), after.take(moved))

    def _by_votes(self, pages: Sequence[_Page]) -> Contacts:
        echoes = join([page.echoes for page in pages])
        cast = np.concatenate([self._no_votes(join([])), *(page.votes for page in pages)])
        return contacts(echoes, cast, self._config)

    def _by_plateaus(self, fine: Sequence[Identity]) -> list[Contacts]:
        """The contacts of each of ``fine`` sweeps; those that go by the same plateaus are read together."""
        read: dict[tuple[Identity, ...], dict[Identity, Contacts]] = {}
        found = []
        for one in fine:
            page = self._pages[one]
            at = self._poses[page.x_m, page.y_m]
            together = tuple(at[sweeps_together(at.index(one), len(at))])
            if together not in read:
                sweeps = [self._pages[other] for other in together]
                looks = [sweep.looks for sweep in sweeps if sweep.looks is not None]
                told = plateau_contacts([sweep.echoes for sweep in sweeps], looks, self._refinement)
                read[together] = dict(zip(together, told, strict=True))
            found.append(read[together][one])
        return found

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
