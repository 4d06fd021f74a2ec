"""The sensors that people buy under one name (firmware/README.md, Sensors): lags, triggers, lines that latch."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from firmware.stepped_unit import SteppedUnit, stepped_unit

from noctule_gateway.wire.frames import AskStatus, Configure, NoEcho, Outcome, Single, State, Status, Sweep

TICKS_PER_S = 4e6
SOUND_M_S = 331.3 + 0.606 * 20.0  # firmware/simulator/README.md, a room's air
STARE = Configure(0, 0, 0, 8, 60, 600, 100, 0, 1)
RANGE_M = 1.7
WALL = f"[[wall]]\nfrom_m = [{RANGE_M}, -9.0]\nto_m = [{RANGE_M}, 9.0]\n"


@contextmanager
def unit_with(tmp_path: Path, firmware: Path, sensor: str, wall: str = WALL) -> Iterator[SteppedUnit]:
    """A unit with this kind of sensor, a wall right in front of it."""
    room = tmp_path / "room.toml"
    room.write_text(f'name = "kind"\n[sensor]\n{sensor}\n{wall}[unit]\nposition_m = [0.0, 0.0]\n')
    with stepped_unit("--room", str(room), image=firmware) as unit:
        unit.greet()
        assert unit.command(STARE) == Outcome.DONE
        yield unit


def echoes(unit: SteppedUnit) -> list[int]:
    """What the readings of one sweep say, straight ahead."""
    assert unit.command(Single(0)) == Outcome.DONE
    unit.wait_for_state(State.IDLE)
    sweep = unit.receive(Sweep)
    unit.acknowledge(sweep)
    return [reading.echo for reading in sweep.readings]


# ESPHome PR 12897 (12.3 ms, and its wait of 80), an M5Stack report (42 ms), the data sheet of the JSN-SR04T (20 us)
@pytest.mark.parametrize(
    "sensor",
    [
        *("echo_lag_ms = 0.45", "echo_lag_ms = 2.3", "echo_lag_ms = 12.3", "echo_lag_ms = 42.0", "echo_lag_ms = 79.5"),
        *("shortest_trigger_us = 20.0", "shortest_trigger_us = 20.0\necho_lag_ms = 12.3", "no_echo_ms = 200.0"),
    ],
)
def test_a_sensor_of_any_kind_measures(tmp_path, firmware, sensor):
    with unit_with(tmp_path, firmware, sensor) as unit:
        for echo in echoes(unit):
            assert echo / TICKS_PER_S == pytest.approx(2 * RANGE_M / SOUND_M_S, abs=1e-6)


def test_a_sensor_that_takes_longer_than_80_ms_is_none(tmp_path, firmware):
    with unit_with(tmp_path, firmware, "echo_lag_ms = 85.0") as unit:
        assert set(echoes(unit)) == {NoEcho.NO_SENSOR}


LATCHES = "no_echo_ms = 1e9\nlost_echo_probability = 0.3"


def test_a_sensor_that_latches_measures_again_where_its_power_can_be_cut(tmp_path, firmware):
    with unit_with(tmp_path, firmware, LATCHES + "\npower_switch = true") as unit:
        found = [echo for _ in range(10) for echo in echoes(unit)]
        measured = [echo for echo in found if echo < NoEcho.NO_SENSOR]
        assert set(found) - set(measured) == {NoEcho.STUCK_HIGH}
        # Seven pings in ten are heard, and each that is not takes two readings: 7 to 6.
        assert len(measured) > len(found) / 3
        for echo in measured:
            assert echo / TICKS_PER_S == pytest.approx(2 * RANGE_M / SOUND_M_S, abs=1e-6)


def test_a_sensor_that_latches_is_named_where_its_power_cannot_be_cut(tmp_path, firmware):
    with unit_with(tmp_path, firmware, LATCHES) as unit:
        found = [echo for _ in range(5) for echo in echoes(unit)]
        latched = found.index(NoEcho.STUCK_HIGH)
        assert set(found[latched:]) == {NoEcho.STUCK_HIGH}
        assert unit.ask(AskStatus(0), Status).echo_faults == len(found) - latched
