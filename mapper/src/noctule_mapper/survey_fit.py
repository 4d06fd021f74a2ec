"""A survey in, a contour out: what ``noctule-mapper fit`` computes. The survey is taken as the live mapper takes a log:
sweeps that can't be mapped are left out, and the map rests on those of the window.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from time import time_ns

from noctule import messages_pb2
from noctule.errors import NoctuleError, SurveyError
from noctule.progress import Progress
from noctule.survey import Record
from noctule_mapper.config import MapperConfig, SensorConfig, Window
from noctule_mapper.left_out import LeftOut, because_of_errors, because_of_window
from noctule_mapper.mapper import Mapper
from noctule_mapper.messages import contour_message
from noctule_mapper.readings import faulty
from noctule_mapper.readings.faulty import Suspect
from noctule_mapper.readings.sweep import FaultyUnitError, SweepError, SweepReadings, from_message
from noctule_mapper.window import Reason, windowed


@dataclass(frozen=True)
class SurveyMap:
    """The map of a survey of ``site``, "" where it has no sweeps, and what of it the map does not rest on."""

    mapper: Mapper
    site: str
    left_out: tuple[LeftOut, ...]


@dataclass(frozen=True)
class _Usable:
    record: Record
    sweep: messages_pb2.Sweep
    readings: SweepReadings


def fit(
    sweeps: Iterable[messages_pb2.Sweep],
    config: MapperConfig | None = None,
    sensor: SensorConfig | None = None,
    window: Window | None = None,
    progress: Progress | None = None,
) -> messages_pb2.Contour:
    """The contour of one site's survey; ``sensor`` stands in for what the sweeps do not say of theirs.

    Raises SurveyError where the sweeps are of several sites, SweepError where none can be mapped.
    """
    records = (Record("survey", number, sweep) for number, sweep in enumerate(sweeps, start=1))
    progress = progress or Progress()
    surveyed = map_survey(records, config, sensor, window, progress)
    progress.at("looking for walls and cylinders")
    return contour_message(surveyed.mapper.contour(), site=surveyed.site)


def map_survey(
    records: Iterable[Record],
    config: MapperConfig | None = None,
    sensor: SensorConfig | None = None,
    window: Window | None = None,
    progress: Progress | None = None,
) -> SurveyMap:
    """The map of one site's survey; arguments and errors as of ``fit``, and SurveyError where no sweep can be read."""
    progress = progress or Progress()
    config = config or MapperConfig()
    usable, failed = _usable(records, sensor or config.sensor, progress)
    if failed and not usable:
        raise failed[0][1]
    sites = sorted({one.sweep.site for one in usable})
    if len(sites) > 1:
        raise SurveyError(f"the survey holds sweeps of several sites ({', '.join(sites)}); fit one site at a time")
    held = windowed([one.sweep for one in usable], window or Window(), time_ns())
    mapper = Mapper(config)
    for done, number in enumerate(held.held):
        progress.at("putting sweeps on the map", done, len(held.held))
        mapper.register_sweep(usable[number].readings)
    outside: list[tuple[Record, Reason]] = [(usable[number].record, reason) for number, reason in held.left.items()]
    left_out = (*because_of_errors(failed), *because_of_window(outside, window or Window()))
    return SurveyMap(mapper, next(iter(sites), ""), left_out)


def _usable(
    records: Iterable[Record], sensor: SensorConfig, progress: Progress
) -> tuple[list[_Usable], list[tuple[Record, NoctuleError]]]:
    """The sweeps that can be mapped, and what is wrong with the others."""
    usable: list[_Usable] = []
    failed: list[tuple[Record, NoctuleError]] = []
    records = list(records)
    suspects = faulty.suspects(record.sweep for record in records if isinstance(record.sweep, messages_pb2.Sweep))
    for done, record in enumerate(records):
        progress.at("reading sweeps", done, len(records))
        if isinstance(record.sweep, SurveyError):
            failed.append((record, record.sweep))
            continue
        try:
            _check_not_suspect(record.sweep, suspects)
            usable.append(_Usable(record, record.sweep, from_message(record.sweep, sensor)))
        except SweepError as error:
            failed.append((record, error))
    return usable, failed


def _check_not_suspect(sweep: messages_pb2.Sweep, suspects: Sequence[Suspect]) -> None:
    """Raise FaultyUnitError where a later sweep of the log says so."""
    for suspect in suspects:
        if suspect.has(sweep):
            raise FaultyUnitError(f"sweep {sweep.log_sequence} of {sweep.log_id!r} is {suspect.reason}", suspect.reason)
