"""Contacts of a unit that stands still: one place tells a contact's direction by its plateau, with no other place near.

A wall, a corner and a cylinder all answer one place with the same plateau. The contact is called a wall, the simplest
kind, as long as nothing speaks against it; its votes are 0, for no other place has agreed.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from noctule_mapper.config import RefinementConfig
from noctule_mapper.contacts.voting import Contacts, Kind
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.echoes import Echoes, join
from noctule_mapper.readings.evidence import evidence
from noctule_mapper.readings.looks import Looks
from noctule_mapper.readings.plateaus import NO_PLATEAU, plateau_of_each

Identity = tuple[str, int]
SWEEPS_TOGETHER = 4  # of one place: two in each direction of the stepper, whose backlash so cancels


def sweeps_together(number: int, count: int) -> slice:
    """Of ``count`` sweeps from one place those whose plateaus give sweep ``number`` its contacts: the sweep and those
    just before it, so that a new sweep changes nothing that an old one said; the first ones go by each other.
    """
    first = max(0, number + 1 - SWEEPS_TOGETHER)
    return slice(first, min(first + SWEEPS_TOGETHER, count))


def sharing_plateaus(sweeps: Sequence[Identity], number: int) -> list[Identity]:
    """Of the ``sweeps`` from one place those whose contacts change when sweep ``number`` comes, or goes from there."""
    first = number if number >= SWEEPS_TOGETHER else 0
    return list(sweeps[first : max(number, SWEEPS_TOGETHER) + SWEEPS_TOGETHER])


def plateau_contacts(
    echoes_of_sweeps: Sequence[Echoes], looks_of_sweeps: Sequence[Looks], config: RefinementConfig
) -> list[Contacts]:
    """The contacts of each of some sweeps from one place, (sweeps,), by the plateaus that all of them make.

    Of the echoes that one plateau has in a sweep, the one whose axis is nearest to the plateau's direction speaks, as
    it does for the free space before it: the others heard the same thing with the same errors.
    """
    echoes, looks = join(echoes_of_sweeps), join([looks.echoes for looks in looks_of_sweeps])
    data = replace(evidence(echoes, echoes.sigma_m, _SPAN_M, config), looks=Looks(looks, np.ones(len(looks))))
    plateau, direction_rad, sigma_rad = plateau_of_each(data, config)
    speaks = _nearest_to(direction_rad, echoes, plateau) & _on_reflector(echoes, sigma_rad)
    found = Contacts(
        direction_rad=np.where(speaks, direction_rad, echoes.axis_rad),
        curvature_per_m=np.zeros(len(echoes)),
        kind=np.where(speaks, Kind.WALL, Kind.NONE),
        votes=np.zeros(len(echoes)),
        direction_sigma_rad=np.where(speaks, sigma_rad, np.inf),
    )
    ends = np.cumsum([len(one) for one in echoes_of_sweeps])
    return [found.take(slice(end - len(one), end)) for one, end in zip(echoes_of_sweeps, ends, strict=True)]


_SPAN_M = 1.0  # plateaus weigh no echo against one from anywhere


def _nearest_to(direction_rad: np.ndarray, echoes: Echoes, plateau: np.ndarray) -> np.ndarray:
    """Which echoes, bool (n,), have the axis nearest to their plateau's direction, of their sweep and plateau."""
    off_rad = np.abs(wrapped(echoes.axis_rad - direction_rad))
    order = np.lexsort((off_rad, plateau, echoes.sweep))
    order = order[plateau[order] != NO_PLATEAU]
    first = np.ones(len(order), bool)
    first[1:] = (np.diff(plateau[order]) != 0) | (np.diff(echoes.sweep[order]) != 0)
    speaks = np.zeros(len(echoes), bool)
    speaks[order[first]] = True
    return speaks


def _on_reflector(echoes: Echoes, sigma_rad: np.ndarray) -> np.ndarray:
    """Which echoes, bool (n,), have their contact on the reflector as surely as their range is known: a direction that
    is off by an angle puts it R angle^2 / 2 before a wall.
    """
    before_m = echoes.range_m * sigma_rad**2 / 2
    return before_m <= echoes.sigma_m
