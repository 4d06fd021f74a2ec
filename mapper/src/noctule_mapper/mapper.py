"""The mapper: the algorithm from sweep to contour, one line per stage; sections and equations are those of Liu et al.
2019.

sensor model -> contacts -> belief fusion on a sparse grid -> features -> walls, cylinders -> contour -> refinement
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from noctule_mapper.config import MapperConfig
from noctule_mapper.contacts.contact_book import ContactBook, ContactChange, Identity
from noctule_mapper.contacts.contact_report import ContactReport, contact_report
from noctule_mapper.contour.contour import Contour, joined
from noctule_mapper.contour.reasons import no_room, reason
from noctule_mapper.contour.stops import parted
from noctule_mapper.placement.unplaced import Unplaced
from noctule_mapper.readings.echoes import Echoes, echoes_of
from noctule_mapper.readings.looks import Looks, Pose, is_fine, looks_of, looks_of_all, pose_of
from noctule_mapper.readings.parts import parts_of, stops_are_rare
from noctule_mapper.readings.persistence import lasting
from noctule_mapper.readings.sweep import SweepReadings
from noctule_mapper.refinement.refine import refine

if TYPE_CHECKING:  # the grid and the paper's own methods, which the default method does without
    from noctule_mapper.grid.bounded import BoundedGrid
    from noctule_mapper.grid.grid import Grid
    from noctule_mapper.paper.features import FeaturePoints


class Mapper:
    """Sweeps of one site in, its contour out. A sweep costs the same however large the map; a contour costs what the
    map holds.
    """

    def __init__(self, config: MapperConfig | None = None) -> None:
        self.config = config or MapperConfig()
        self._grid: BoundedGrid | None = None  # until it is looked at
        self._contacts = ContactBook(self.config.contacts, self.config.refinement)
        self._sweeps: dict[Identity, SweepReadings] = {}
        self._came: dict[Identity, None] = {}  # as they came, those that wait for a pose too
        self._unplaced = Unplaced()  # sweeps of units whose poses are to be found
        self._lasting: dict[Identity, SweepReadings] = {}  # with those echoes alone that last
        self._places: dict[Pose, list[Identity]] = {}  # of units that stand still
        self._numbers: dict[Identity, int] = {}
        self._registered = 0
        self._units: dict[str, int] = {}  # a number for each unit
        self._report: ContactReport | None = None  # of the sweeps that are on the map, once it is asked for
        self._points: FeaturePoints | None = None  # likewise
        self._parts: dict[frozenset[Identity], Contour] = {}  # refined, as they were at the last contour

    def register_sweep(self, sweep: SweepReadings) -> None:
        """Put a sweep on the map; one that is there already changes nothing, one whose pose is unknown waits until its
        unit is found.
        """
        self._came.setdefault(sweep.identity)
        placed = self._unplaced.take(sweep) if sweep.pose_is_unknown else sweep
        if placed is not None and placed.identity not in self._sweeps:
            self._register(placed)

    def _register(self, sweep: SweepReadings) -> None:
        self._registered += 1
        self._sweeps[sweep.identity], self._numbers[sweep.identity] = sweep, self._registered
        self._lasting[sweep.identity] = sweep
        self._free(sweep)
        echoes, looks = self._echoes(sweep), self._looks([sweep])
        self._update(self._contacts.add(sweep.identity, sweep.x_m, sweep.y_m, echoes, looks))  # II.B
        if is_fine(sweep):
            self._places.setdefault(pose_of(sweep), []).append(sweep.identity)
            self._judge_again(pose_of(sweep))

    def remove_sweep(self, identity: Identity) -> None:
        """Take a sweep off the map; one that is not there changes nothing."""
        self._came.pop(identity, None)
        self._unplaced.drop(identity)
        sweep = self._sweeps.pop(identity, None)
        if sweep is None:
            return
        self._update(self._contacts.remove(identity))
        self._unfree(self._lasting.pop(identity))
        del self._numbers[identity]
        if is_fine(sweep):
            self._places[pose_of(sweep)].remove(identity)
            self._judge_again(pose_of(sweep))
        while self._grid is not None and (left_out := self._grid.next_left_out()) is not None:
            if not self._add_to(self._grid, left_out):
                break  # it waits behind the others now

    def sweeps(self) -> list[SweepReadings]:
        """The sweeps on the map and those that wait for a pose, as they came."""
        return [*map(self._unplaced.as_it_came, self._sweeps.values()), *self._unplaced.waiting()]

    @property
    def grid(self) -> "Grid":
        """III.A, Eq. 3-4: the reliability grid. It is made when it is first looked at, for the default method does
        without; from then on it goes along with the sweeps.
        """
        if self._grid is None:
            from noctule_mapper.grid.bounded import BoundedGrid

            grid = BoundedGrid(self.config.grid, self.config.rule)
            for identity in self._lasting:
                self._add_to(grid, identity)
            self._grid = grid
        return self._grid.grid

    def draw_grid(self) -> None:
        """Make the grid now: then sweeps that break it are known as they come, and a contour's note says for how many
        it has no room.
        """
        _ = self.grid

    @property
    def off_grid(self) -> int:
        """How many sweeps the grid has no room for; none until it is looked at."""
        return 0 if self._grid is None else self._grid.left_out

    def contact_report(self) -> ContactReport:
        """II.B: what each reading touched, by its tangent circle (Fig. 2) and by the R2d test (Eq. 1-2)."""
        if self._report is None:
            self._report = contact_report(self._contacts.echoes(), self._contacts.contacts(), self.config)
        return self._report

    def feature_points(self) -> "FeaturePoints":
        """III.D: where reflectors were touched, from the grid as it is; worked out once for the sweeps on the map."""
        if self._points is None:
            from noctule_mapper.paper.features import feature_points

            report = self.contact_report()
            self._points = feature_points(self.grid.tiles(), report.echoes, report.touched, self.config.features)
        return self._points

    def contour(self) -> Contour:
        """The contour of all sweeps on the map, by the method that the configuration names."""
        for sweep in self._unplaced.seek(list(self._sweeps.values()), self.config):
            self._register(sweep)
        newest_s = _newest_s([self._sweeps[identity] for identity in self._came if identity in self._sweeps])
        heard_from_m = self._contacts.heard_from_m()
        found = self._contour() if len(heard_from_m) else Contour()
        lacks = reason(found, heard_from_m, list(self._sweeps.values()), self.config)
        note = "; ".join(filter(None, (lacks, no_room(self.off_grid, self.config.grid))))
        now, stops = parted(found.poses, self._sweeps.values())
        poses, method = self._unplaced.published(now), self.config.method
        return replace(
            found, poses=poses, stops=stops, sweeps=len(self._sweeps), time_s=newest_s, method=method, note=note
        )

    def _contour(self) -> Contour:
        if self.config.method == "hough":
            from noctule_mapper.paper.hough import hough

            return hough(self.feature_points(), self.contact_report().echoes, self.config)  # IV.A, Eq. 9
        if self.config.method == "eht-lsm":
            from noctule_mapper.paper.eht_lsm import eht_lsm

            return eht_lsm(self.feature_points(), self.contact_report().echoes, self.config)  # IV.B-D, Eq. 10-23
        return self._refined()  # beyond the paper: on the raw ranges

    def _refined(self) -> Contour:
        """Each part of the site by itself; one whose sweeps are those of last time stays as it was."""
        parts = {}
        for sweeps in parts_of(list(self._lasting.values()), self.config.parts):
            of = [sweep.identity for sweep in sweeps]
            key = frozenset(of)
            parts[key] = self._parts.get(key) or self._refined_part(sweeps, of)
        self._parts = parts
        return joined(list(parts.values()))

    def _refined_part(self, sweeps: Sequence[SweepReadings], of: Sequence[Identity]) -> Contour:
        echoes = self._contacts.echoes(of)
        if not len(echoes):
            return Contour()
        looks = self._looks(sweeps)
        if looks is None and stops_are_rare(sweeps, self.config.parts):
            looks = looks_of_all(sweeps, self.config.noise.assumed_sigma_m, self._units)
        return refine(echoes, self._contacts.contacts(of), looks, self.config, list(self._units))

    def _judge_again(self, pose: Pose) -> None:
        """Which echoes last of the sweeps from one pose may have changed with the last sweep that came or went."""
        at = self._places[pose]
        sweeps = [self._sweeps[identity] for identity in at]
        for sweep, lasts in zip(sweeps, lasting(sweeps), strict=True):
            old = self._lasting[sweep.identity]
            if not np.array_equal(np.isfinite(old.range_m), lasts):
                new = replace(sweep, range_m=np.where(lasts, sweep.range_m, np.nan))
                self._lasting[sweep.identity] = new
                gone, come = self._contacts.exchange(sweep.identity, self._echoes(new), self._looks([new]))
                self._update(gone)
                self._unfree(old)
                self._free(new)
                self._update(come)
        if not at:
            del self._places[pose]

    def _echoes(self, sweep: SweepReadings) -> Echoes:
        unit = self._units.setdefault(sweep.unit, len(self._units))
        return echoes_of(sweep, self._numbers[sweep.identity], self.config.noise.assumed_sigma_m, unit)

    def _looks(self, sweeps: Sequence[SweepReadings]) -> Looks | None:
        return looks_of(sweeps, self.config.noise.assumed_sigma_m, self._units)

    def _free(self, sweep: SweepReadings) -> None:
        """II.A, Eq. 5-8: what lies before the arcs."""
        if self._grid is not None:
            self._grid.add(sweep, self._numbers[sweep.identity])

    def _unfree(self, sweep: SweepReadings) -> None:
        if self._grid is not None:
            self._grid.remove(sweep, self._numbers[sweep.identity])

    def _update(self, change: ContactChange) -> None:
        """III.C: a reading speaks of the region about its contact; a sweep's coming or going moves some contacts."""
        self._report = self._points = None
        if self._grid is not None:
            self._grid.update(change)

    def _add_to(self, grid: "BoundedGrid", identity: Identity) -> bool:
        """Put a sweep that is on the map into ``grid`` with its contacts, if there is room; whether there was."""
        has_room = grid.add(self._lasting[identity], self._numbers[identity])
        if has_room:
            grid.grid.add_contacts(self._contacts.echoes([identity]), self._contacts.contacts([identity]))
        return has_room


def _newest_s(sweeps: Sequence[SweepReadings]) -> float:
    """The latest time since the clock of the last of ``sweeps``, which are as they came, was set; 0 of no sweeps."""
    return max((sweep.time_s for sweep in sweeps if sweep.clock_epoch == sweeps[-1].clock_epoch), default=0.0)
