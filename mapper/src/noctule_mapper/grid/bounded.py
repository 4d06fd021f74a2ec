"""The grid of a map that has no more tiles than its configuration allows, however far apart its sweeps are."""

import numpy as np

from noctule_mapper.choices import Rule
from noctule_mapper.config import GridConfig
from noctule_mapper.contacts.contact_book import ContactChange, Identity
from noctule_mapper.contacts.voting import Contacts
from noctule_mapper.grid.grid import Grid
from noctule_mapper.readings.echoes import Echoes
from noctule_mapper.readings.sweep import SweepReadings


class BoundedGrid:
    """A sweep whose free space would take more tiles than there may be is left out as a whole, its contacts too, so
    that it can be taken off as it was put on. Each sweep has a number, which its echoes bear.
    """

    def __init__(self, config: GridConfig, rule: Rule) -> None:
        self.grid = Grid(config, rule)
        self._most_tiles = config.most_tiles
        self._left_out: dict[int, Identity] = {}

    @property
    def left_out(self) -> int:
        """How many sweeps are left out now."""
        return len(self._left_out)

    def add(self, sweep: SweepReadings, number: int) -> bool:
        """Put in the free space of a sweep; whether there was room."""
        self.grid.add_sweep(sweep)
        has_room = not self.grid.has_more_tiles_than(self._most_tiles)
        if not has_room:
            self.grid.add_sweep(sweep, sign=-1)
            self._left_out[number] = sweep.identity
        return has_room

    def remove(self, sweep: SweepReadings, number: int) -> None:
        """Take out the free space of a sweep, after its contacts."""
        if self._left_out.pop(number, None) is None:
            self.grid.add_sweep(sweep, sign=-1)

    def update(self, change: ContactChange) -> None:
        """Put contacts in the place of others."""
        self._add_contacts(change.echoes, change.before, sign=-1)
        self._add_contacts(change.echoes, change.after)

    def next_left_out(self) -> Identity | None:
        """A sweep that is left out, to be added again with its contacts: each in turn."""
        return self._left_out.pop(next(iter(self._left_out))) if self._left_out else None

    def _add_contacts(self, echoes: Echoes, found: Contacts, sign: int = 1) -> None:
        if self._left_out:
            has_room = ~np.isin(echoes.sweep, list(self._left_out))
            echoes, found = echoes.take(has_room), found.take(has_room)
        self.grid.add_contacts(echoes, found, sign)
