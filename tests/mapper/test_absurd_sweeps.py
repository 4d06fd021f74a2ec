"""Numbers that are finite and absurd: a sweep is refused by name, or mapped in bounded time and memory."""

import json
import math
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from google.protobuf.json_format import Parse
from hypothesis import given, settings
from hypothesis import strategies as st

from noctule import bounds
from noctule.messages_pb2 import Sweep
from noctule_mapper.choices import Method
from noctule_mapper.config import GridConfig, MapperConfig, SensorConfig
from noctule_mapper.mapper import Mapper
from noctule_mapper.messages import contour_message
from noctule_mapper.readings.sweep import SweepError, SweepReadings, from_message
from noctule_mapper.survey_fit import fit

ECHO = {"bearing_rad": 0.1, "time_of_flight_s": 0.006}


def message(number: int = 1, **changes: object) -> Sweep:
    fields = {
        "site": "s",
        "unit": "u7",
        "log_id": "log",
        "log_sequence": number,
        "start": "2026-01-01T00:00:00Z",
        "pose": {"x_m": 0.2 * number, "heading_rad": 0.1},
        "readings": [ECHO],
    }
    return Parse(json.dumps(fields | changes), Sweep())


ABSURD = [
    ("beam_width_rad", {"sensor": {"beam_width_rad": 1e-300}}),
    ("beam_width_rad", {"sensor": {"beam_width_rad": 1e-7}}),
    ("heading_rad", {"pose": {"heading_rad": 1.7e308}}),
    ("bearing_rad", {"readings": [ECHO | {"bearing_rad": 1.7e308}]}),
    ("bearing_rad", {"readings": [ECHO | {"bearing_rad": -1e9}]}),
    ("sigma_position_m", {"pose": {"sigma_position_m": 1e160}}),
    ("sigma_heading_rad", {"pose": {"sigma_heading_rad": 1e160}}),
    ("range_sigma_m", {"sensor": {"range_sigma_m": 1e-7}}),
    ("range_sigma_m", {"sensor": {"range_sigma_m": 5e-324}}),
    ("range_bias_m", {"sensor": {"range_bias_m": -1e300}}),
    ("air_temperature_c", {"air_temperature_c": 294}),
    ("air_temperature_c", {"air_temperature_c": 1e308}),
    ("x_m", {"pose": {"x_m": 1e300}}),
    ("10000 readings", {"readings": [ECHO] * 10_000}),
]


@pytest.mark.parametrize(("field", "changes"), ABSURD)
def test_an_absurd_sweep_is_refused_by_name(field: str, changes: dict) -> None:
    with pytest.raises(SweepError, match=rf"sweep 1 of 'log' \(unit 'u7'\)(:| has) {field}"):
        from_message(message(**changes))
    with pytest.raises(SweepError, match=field):
        fit([message(1, **changes)])
    assert fit([message(2), message(1, **changes)]).sweeps == 1


def test_an_absurd_time_of_flight_is_no_echo() -> None:
    flights_s = (1e308, -1e308, 1e-308, 0.0)
    readings = from_message(message(readings=[ECHO | {"time_of_flight_s": one} for one in flights_s]))
    assert np.isnan(readings.range_m).all()


def test_readings_that_did_not_come_from_a_message_are_looked_at_as_well() -> None:
    good = from_message(message())
    for changes in (
        {"range_m": np.array([np.inf])},
        {"range_m": np.array([1e-300])},
        {"range_m": np.ones(3)},
        {"beam_width_rad": math.nan},
    ):
        with pytest.raises(SweepError, match="sweep 1 of 'log'"):
            replace(good, **changes)


@pytest.mark.parametrize("field", ["wall_nats", "point_nats", "cylinder_nats"])
def test_objects_that_cost_nothing_can_not_be_asked_for(field: str) -> None:
    # Selection adds objects while one is worth more than its price: at a price of 0 it would never end.
    with pytest.raises(ValueError, match=field):
        MapperConfig.model_validate({"refinement": {"prices": {field: 0.0}}})


def edge(low: float, high: float) -> st.SearchStrategy[float]:
    """Mostly the ends of what is allowed."""
    return st.sampled_from([low, high]) | st.floats(low, high)


def bound(message: str, field: str) -> st.SearchStrategy[float]:
    """A number of a message, mostly at its bounds."""
    allowed = bounds.number(message, field)
    return edge(allowed.least, allowed.most)


ECHOES = st.lists(
    st.tuples(bound("Reading", "bearing_rad") | st.just(0.0), edge(0.02, 4.0) | st.just(math.nan)), max_size=4
)
SWEEPS = st.builds(
    lambda x_m, y_m, heading, place, turn, beam, sigma, echoes, copies: SweepReadings(
        identity=("log", 0),
        unit="u",
        time_s=0.0,
        x_m=x_m,
        y_m=y_m,
        heading_rad=heading,
        sigma_position_m=place,
        sigma_heading_rad=turn,
        bearing_rad=np.array([bearing for bearing, _ in echoes] * copies),
        range_m=np.array([range_m for _, range_m in echoes] * copies),
        no_echo=np.zeros(len(echoes) * copies, bool),
        beam_width_rad=beam,
        range_sigma_m=sigma,
    ),
    bound("Pose", "x_m") | st.just(0.0),
    bound("Pose", "y_m") | st.sampled_from([0.0, 0.2, 0.4]),
    bound("Pose", "heading_rad") | st.just(0.0),
    bound("Pose", "sigma_position_m"),
    bound("Pose", "sigma_heading_rad"),
    bound("Sensor", "beam_width_rad"),
    st.none() | bound("Sensor", "range_sigma_m"),
    ECHOES,
    st.sampled_from([1, 16]),
)


@pytest.mark.parametrize("method", ["refined", "eht-lsm", "hough"])
@settings(max_examples=20)
@given(sweeps=st.lists(SWEEPS, max_size=5))
def test_sweeps_at_the_edge_of_what_is_allowed_are_mapped(method: Method, sweeps: list[SweepReadings]) -> None:
    mapper = Mapper(MapperConfig(method=method))
    for number, sweep in enumerate(sweeps):
        mapper.register_sweep(replace(sweep, identity=("log", number)))
    bounds.check(contour_message(mapper.contour(), "s"))


@settings(max_examples=20)
@given(sweeps=st.lists(SWEEPS, max_size=5))
def test_a_grid_that_sweeps_at_the_edge_of_what_is_allowed_come_to_and_leave_is_empty(
    sweeps: list[SweepReadings],
) -> None:
    mapper = Mapper(MapperConfig())
    mapper.draw_grid()  # from here on it goes along with every sweep, as it does live
    for number, sweep in enumerate(sweeps):
        mapper.register_sweep(replace(sweep, identity=("log", number)))
    bounds.check(contour_message(mapper.contour(), "s"))  # its note tells of sweeps that the grid has no room for
    for number in range(len(sweeps)):
        mapper.remove_sweep(("log", number))
    assert mapper.grid.tiles() == []


@pytest.mark.parametrize("cell_m", [0.002, 0.02])
def test_the_dearest_readings_there_can_be_cost_bounded_time_and_memory(cell_m: float) -> None:
    sensor = SensorConfig(longest_range_m=20.0)
    mapper = Mapper(MapperConfig(sensor=sensor, grid=GridConfig(cell_m=cell_m)))
    turns = np.linspace(-math.pi, math.pi, 8)
    assert mapper.grid.tiles() == []
    for number in range(3):
        far = SweepReadings(
            identity=("log", number),
            unit="u",
            time_s=0.0,
            x_m=0.2 * number,
            y_m=0.0,
            heading_rad=0.0,
            sigma_position_m=0.0,
            sigma_heading_rad=0.0,
            bearing_rad=turns,
            range_m=np.full(len(turns), 20.0),
            no_echo=np.zeros(len(turns), bool),
            beam_width_rad=math.pi,
            range_sigma_m=0.5,
        )
        mapper.register_sweep(far)
    assert 0 < len(mapper.grid.changed()) < 40_000


@pytest.mark.parametrize("method", ["eht-lsm", "hough"])
def test_a_wall_along_a_path_of_hundreds_of_metres_takes_no_more_memory_than_its_points(method: Method) -> None:
    # Aslant and 3 km from the origin: the box about the path has 6e7 cells, lines there 1e8 bins of rho and theta.
    mapper = Mapper(MapperConfig(method=method))
    abreast = [{"bearing_rad": turn, "time_of_flight_s": 0.006} for turn in (-0.1, 0.0, 0.1)]
    for number in range(300):
        pose = {"x_m": 3000 + 0.5 * number, "y_m": 0.5 * number, "heading_rad": 0.75 * math.pi}
        mapper.register_sweep(from_message(message(number, pose=pose, readings=abreast)))
    assert len(mapper.grid.tiles()) > 200
    tracemalloc.start()
    contour = mapper.contour()
    _, peak_bytes = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert contour.walls
    assert peak_bytes < 300e6
