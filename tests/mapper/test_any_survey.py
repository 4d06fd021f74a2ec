"""Any survey that the bus may carry, sense or nonsense: a file, an export and the live map take it, in bounded time."""

import math
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from noctule import bounds, survey
from noctule.errors import NoctuleError
from noctule.messages_pb2 import Sweep
from noctule_mapper.choices import Method
from noctule_mapper.config import MapperConfig, Window
from noctule_mapper.export.files import export_file
from noctule_mapper.live.store import SweepStore
from noctule_mapper.mapper import Mapper
from noctule_mapper.messages import contour_message, features_message, tile_message
from noctule_mapper.readings.sweep import SweepError, from_message
from noctule_mapper.survey_fit import fit

pytestmark = pytest.mark.filterwarnings("error")
WITHIN_S = 30  # a survey of a few sweeps takes well under one on an idle processor

FINE_RAD = [math.radians(4.5 * step - 135) for step in range(61)]
COARSE_RAD = [math.radians(22.5 * step - 135) for step in range(13)]
SAME_RAD = [0.0] * 12


def number(message: str, field: str, *likely: float) -> st.SearchStrategy[float]:
    """Mostly what is likely, else from one bound to the other, both included."""
    allowed = bounds.number(message, field)
    edges = st.sampled_from([allowed.least, allowed.most]) | st.floats(allowed.least, allowed.most)
    return st.sampled_from(likely) | edges if likely else edges


flights_s = st.none() | number("Reading", "time_of_flight_s", 0.0, 0.0029, 0.0058, 0.0058, 0.0117, 0.0234, 1e-9)
hearing = st.one_of(
    st.builds(lambda flight_s: lambda _: flight_s, flights_s),  # the same all round
    st.builds(lambda some_s: lambda step: some_s[step % len(some_s)], st.lists(flights_s, min_size=1, max_size=7)),
    # A flat wall, or the inside of a drum.
    st.builds(lambda at: lambda step: 0.006 / max(abs(math.cos(0.08 * step - at)), 0.2), st.floats(0, 3)),
)


@st.composite
def sweeps(draw: st.DrawFn) -> Sweep:
    made = Sweep(site="s", unit=draw(st.sampled_from(["u1", "u2", "u3"])), log_sequence=draw(st.integers(0, 6)))
    made.log_id = draw(st.sampled_from(["", f"log of {made.unit}"]))
    made.sequence = draw(st.integers(0, 3))
    if draw(st.integers(0, 9)):
        made.pose.x_m = draw(number("Pose", "x_m", 0.0, 0.0, 0.2, 2.0))
        made.pose.y_m = draw(number("Pose", "y_m", 0.0, 0.0, 1.5))
        made.pose.heading_rad = draw(number("Pose", "heading_rad", 0.0, 0.0, math.pi))
        made.pose.sigma_position_m = draw(number("Pose", "sigma_position_m", 0.0, 0.0, 0.03))
        made.pose.sigma_heading_rad = draw(number("Pose", "sigma_heading_rad", 0.0, 0.0, 0.05))
    if draw(st.booleans()):
        made.sensor.beam_width_rad = draw(number("Sensor", "beam_width_rad", 0.39))
        made.sensor.range_sigma_m = draw(number("Sensor", "range_sigma_m", 0.003))
        made.sensor.range_bias_m = draw(number("Sensor", "range_bias_m", 0.0, 0.0023))
        made.air_temperature_c = draw(number("Sweep", "air_temperature_c", 20.0))
    made.start.seconds = int(draw(number("Timestamp", "seconds", 0.0, 1.8e9, 1.8e9 + 1)))
    heard: Callable[[int], float | None] = draw(hearing)
    status = draw(st.sampled_from([0, 0, 0, 1, 2, 3, 4, 5, 63]))
    for step, bearing_rad in enumerate(draw(st.sampled_from([FINE_RAD, COARSE_RAD, SAME_RAD, COARSE_RAD[:1], []]))):
        reading = made.readings.add(bearing_rad=bearing_rad, status=status if step % 3 else 0)
        if (flight_s := heard(step)) is not None:
            reading.time_of_flight_s = flight_s
    bounds.check(made)
    return made


surveys = st.lists(sweeps(), max_size=6)


@settings(max_examples=40, deadline=1000 * WITHIN_S)
@given(made=surveys, method=st.sampled_from(["refined", "refined", "eht-lsm", "hough"]))
def test_any_survey_is_fitted_and_exported(made: list[Sweep], method: Method) -> None:
    with TemporaryDirectory() as folder:
        source = Path(folder) / "survey.jsonl"
        with source.open("w") as stream:
            survey.write(made, stream)
        try:
            contour = fit(made, MapperConfig(method=method))
        except SweepError:
            contour = None  # no sweep that can be mapped
        if contour is not None:
            survey.to_json(contour)  # checks every number: finite, within its bounds
            assert contour.note or contour.walls or contour.cylinders
        for out in ("map.geojson", "map.dxf", "map.yaml"):
            try:
                export_file(source, Path(folder) / out)
            except NoctuleError:
                assert contour is None or out == "map.yaml"  # a map of places 20 km apart is refused by its size


@settings(max_examples=40, deadline=1000 * WITHIN_S)
@given(made=surveys, most=st.integers(1, 6))
def test_any_log_is_mapped_live_as_it_comes_and_goes(made: list[Sweep], most: int) -> None:
    with TemporaryDirectory() as folder:
        store, mapper = SweepStore(Path(folder) / "s.sqlite3", Window(max_sweeps=most, sweeps_per_place=2)), Mapper()
        mapper.grid.tiles()
        for sweep in made:
            try:
                from_message(sweep)
            except SweepError:
                continue
            change = store.commit([sweep], [])
            for identity in change.left:
                mapper.remove_sweep(identity)
            for entered in change.entered:
                mapper.register_sweep(from_message(entered))
        held = store.sweeps()
        store.close()
    assert {sweep.identity for sweep in mapper.sweeps()} == {from_message(sweep).identity for sweep in held}
    contour = mapper.contour()
    bounds.check(contour_message(contour, "s"))
    bounds.check(features_message(mapper.feature_points(), "s"))
    for tile in mapper.grid.changed():
        bounds.check(tile_message(tile, "s"))
    for sweep in mapper.sweeps():
        mapper.remove_sweep(sweep.identity)
    assert mapper.grid.tiles() == []
