"""Times of flight by the real firmware in noctule-sim: how exact, how often, and why there is none."""

import random
import statistics
from itertools import pairwise

import pytest
from firmware.flood import flood
from firmware.stepped_unit import SteppedUnit, stepped_unit

from noctule_gateway.wire.frames import AskStatus, Configure, Reading, Single, Start, Status, Stop, Sweep

# firmware/README.md, Frames and the table of echoes
TICKS_PER_S = 4_000_000
TICKS_PER_OFFSET = 16
NO_ECHO, TOO_EARLY, STUCK_HIGH, NO_SENSOR = 0xFFFFFF, 0xFFFFFE, 0xFFFFFD, 0xFFFFFC
IDLE = 0
# firmware/simulator/README.md: the speed of sound, and what happens between trigger and echo
SOUND_M_S = 331.3 + 0.606 * 20.0
TRIGGER_TO_RISE_S = 25e-6 + 450e-6

STARE = Configure(0, 0, 0, 64, 29, 600, 100, 0, 1)


def wall_at(range_m: float, sensor: str = "") -> str:
    """A room of one wall right in front of the unit, without noise."""
    return f"""
        name = "wall"
        air_temperature_c = 20.0
        {sensor}
        [[wall]]
        from_m = [{range_m}, -9.0]
        to_m = [{range_m}, 9.0]
        [unit]
        position_m = [0.0, 0.0]
        heading_deg = 0.0
    """


@pytest.fixture
def facing(tmp_path, firmware):
    """A function that gives a unit in the room of this description, which has said hello."""
    opened = []

    def face(room: str) -> SteppedUnit:
        file = tmp_path / "room.toml"
        file.write_text(room)
        context = stepped_unit("--room", str(file), image=firmware)
        unit = context.__enter__()
        opened.append(context)
        unit.greet()
        return unit

    yield face
    for context in opened:
        context.__exit__(None, None, None)


def sweep(unit: SteppedUnit) -> Sweep:
    """The next sweep that the unit makes."""
    made = unit.receive(Sweep, within_s=60)
    unit.acknowledge(made)
    return made


def one_sweep(unit: SteppedUnit, plan: Configure) -> Sweep:
    assert unit.command(plan) == 0
    assert unit.command(Single(0)) == 0
    unit.wait_for_state(IDLE)
    return sweep(unit)


def triggers_s(made: Sweep) -> list[float]:
    return [(made.start + reading.offset * TICKS_PER_OFFSET) / TICKS_PER_S for reading in made.readings]


def width_error_s(reading: Reading, range_m: float) -> float:
    return reading.echo / TICKS_PER_S - 2 * range_m / SOUND_M_S


@pytest.mark.parametrize("range_m", [0.0205, 0.5, 1.7, 2.81, 3.99])
def test_an_echos_width_is_the_time_of_flight_to_a_microsecond(facing, range_m):
    made = one_sweep(facing(wall_at(range_m)), STARE)
    assert len(made.readings) == 64
    for reading in made.readings:
        assert abs(width_error_s(reading, range_m)) <= 1e-6


def test_no_load_on_the_line_moves_an_edge(facing):
    range_m = 1.234
    flight_s = 2 * range_m / SOUND_M_S
    unit = facing(wall_at(range_m))
    assert unit.command(STARE) == 0
    assert unit.command(Start(0, 0)) == 0
    readings, beside_a_wrap = 0, 0
    for made in flood(unit, 60.0, random.Random(1)):
        for reading, trigger_s in zip(made.readings, triggers_s(made), strict=True):
            assert abs(width_error_s(reading, range_m)) <= 1e-6
            readings += 1
            rise = round((trigger_s + TRIGGER_TO_RISE_S) * TICKS_PER_S)
            fall = rise + round(flight_s * TICKS_PER_S)
            # the count that captures the edges has 16 bits; its wraps are counted by the interrupt that takes the edges
            beside_a_wrap += sum((edge + 80) % 65536 < 160 for edge in (rise, fall))
    assert readings > 1500
    assert beside_a_wrap > 2
    assert unit.ask(AskStatus(0), Status, within_s=20).frames_bad > 1500


@pytest.mark.parametrize("interval_ms", [29, 60, 250])
def test_pings_come_at_their_interval_and_never_sooner(facing, interval_ms):
    unit = facing(wall_at(1.0))
    made = one_sweep(unit, Configure(0, 0, 0, 20, interval_ms, 600, 100, 0, 1))
    # pings are made in rounds of 2 ms; an offset counts whole 4 us
    expected_s = (interval_ms + interval_ms % 2) * 1e-3
    intervals_s = [after - before for before, after in pairwise(triggers_s(made))]
    assert min(intervals_s) >= interval_ms * 1e-3 - 4e-6
    assert max(intervals_s) <= expected_s + 2.2e-3
    assert statistics.median(intervals_s) == pytest.approx(expected_s, abs=5e-5)


def test_the_interval_holds_from_one_sweep_to_the_next(facing):
    unit = facing(wall_at(1.0))
    assert unit.command(Configure(0, 0, 0, 2, 400, 600, 100, 0, 1)) == 0
    assert unit.command(Start(0, 0)) == 0
    pings = [trigger for _ in range(4) for trigger in triggers_s(sweep(unit))]
    for before, after in pairwise(pings):
        assert 0.4 - 4e-6 <= after - before <= 0.4022


def test_a_ping_waits_for_the_line_to_be_low(facing):
    # nothing to hear: the line is high for 38 ms, longer than the interval; a sensor still busy would not answer
    unit = facing(wall_at(5.0))
    made = one_sweep(unit, STARE)
    assert {reading.echo for reading in made.readings} == {NO_ECHO}
    for before, after in pairwise(triggers_s(made)):
        assert after - before >= 38e-3 + TRIGGER_TO_RISE_S


@pytest.mark.parametrize(
    ("fault", "echo"),
    [
        ("sensor_deaf", NO_ECHO),
        ("sensor_short_pulse", TOO_EARLY),
        ("sensor_too_early", TOO_EARLY),
        ("sensor_stuck_high", STUCK_HIGH),
        ("sensor_missing", NO_SENSOR),
    ],
)
def test_each_reading_says_why_there_is_no_echo_and_the_link_goes_on(facing, fault, echo):
    unit = facing(wall_at(1.0))
    plan = Configure(0, 0, 0, 8, 60, 600, 100, 20, 1)
    one_sweep(unit, plan)
    unit.inject(fault)
    assert unit.command(Single(0)) == 0
    for _ in range(5):
        unit.ask(AskStatus(0), Status, within_s=0.1)
    unit.wait_for_state(IDLE)
    made = sweep(unit)
    assert {reading.echo for reading in made.readings} == {echo}
    faults = unit.ask(AskStatus(0), Status).echo_faults
    assert faults == (0 if echo == NO_ECHO else len(made.readings))

    assert unit.truth["resets"] == 0
    unit.inject("mended")
    for reading in one_sweep(unit, plan).readings:
        assert abs(width_error_s(reading, 1.0)) <= 1e-6


@pytest.mark.parametrize("pings", [1, 3, 5])
def test_a_readings_time_is_its_middle_pings(facing, pings):
    made = one_sweep(facing(wall_at(1.0)), Configure(0, 0, 0, 5, 60, 600, 100, 0, pings))
    triggers = triggers_s(made)
    middle = pings // 2 * 0.06
    assert middle - 4e-6 <= triggers[0] - made.start / TICKS_PER_S <= middle + pings * 2.2e-3
    for before, after in pairwise(triggers):
        assert pings * 0.06 - 4e-6 <= after - before <= pings * 0.0622


def test_a_median_of_five_outvotes_lost_and_false_echoes(facing):
    unit = facing(wall_at(1.0, "sensor = { lost_echo_probability = 0.15, false_echo_probability = 0.05 }"))

    def wrong(pings: int) -> int:
        assert unit.command(Configure(0, 0, 0, 64, 29, 600, 100, 0, pings)) == 0
        assert unit.command(Start(0, 0)) == 0
        readings = [reading for _ in range(4) for reading in sweep(unit).readings]
        assert unit.command(Stop(0)) == 0
        unit.wait_for_state(IDLE)
        return sum(abs(width_error_s(reading, 1.0)) > 1e-6 for reading in readings)

    # binomial: one ping in 5.2 is wrong; three or more of five, and on the same side, in less than 1 of 20
    assert wrong(1) > 256 * 0.13
    assert wrong(5) < 256 * 0.07
