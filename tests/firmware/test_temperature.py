"""The chip's own thermometer and its one-point calibration."""

import statistics
from pathlib import Path

import pytest
from firmware.stepped_unit import SteppedUnit, stepped_unit

from noctule_gateway.wire.frames import (
    NO_TEMPERATURE,
    AskSettings,
    AskStatus,
    Hello,
    Outcome,
    Settings,
    Single,
    Status,
    Store,
    Sweep,
    TrimTemperature,
)

# firmware/README.md: a mean takes some two seconds.
FIRST_MEAN_S = 2.5


def room(folder: Path, air_c: float) -> str:
    text = f"name = 'room'\nair_temperature_c = {air_c}\n[unit]\nposition_m = [0.0, 0.0]\n"
    place = folder / f"room-{air_c}.toml"
    place.write_text(text)
    return str(place)


def temperature(unit: SteppedUnit) -> int:
    return unit.ask(AskStatus(0), Status).temperature


def means(unit: SteppedUnit, number: int) -> list[int]:
    found = []
    for _ in range(number):
        unit.run(FIRST_MEAN_S)
        found.append(temperature(unit))
    return found


def test_it_is_measured_only_after_a_while_and_cannot_be_trimmed_before():
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        assert temperature(unit) == NO_TEMPERATURE
        assert unit.command(TrimTemperature(0, 2000)) == Outcome.BUSY
        unit.run(FIRST_MEAN_S)
        assert temperature(unit) != NO_TEMPERATURE
        assert unit.command(TrimTemperature(0, 2000)) == Outcome.DONE


@pytest.mark.parametrize("seed", range(1, 6))
@pytest.mark.parametrize("air_c", [-10.0, 21.0, 45.0])
def test_an_untrimmed_chip_is_off_by_what_the_datasheet_allows(tmp_path, air_c, seed):
    with stepped_unit("--room", room(tmp_path, air_c), "--seed", str(seed)) as unit:
        unit.greet()
        (measured,) = means(unit, 1)
        # Datasheet: offset 776 +- 8.5 mV, gain 2.86 mV/K +- 1.2 % (one sigma, the simulator's chips within two),
        # reference 2.44 V +- 2.5 %; and the simulator's chips are 3 K warmer than the air.
        chip_c = air_c + 3.0
        sensor_mv = 776 + 2.86 * chip_c
        worst_k = (2 * 8.51 + 2 * 0.0335 * abs(chip_c) + 0.06 / 2.38 * sensor_mv) / 2.86
        assert measured / 100 == pytest.approx(chip_c, abs=worst_k + 0.3)


def test_means_of_a_steady_temperature_scatter_by_a_tenth_of_a_degree():
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        scatter = statistics.stdev(means(unit, 40))
        # 0.6 codes of noise (simulator: assumed) and 0.29 of rounding, 0.83 K each, over 64 conversions: 0.07 K
        assert 2 < scatter < 14


@pytest.mark.parametrize("seed", range(1, 6))
def test_a_trimmed_unit_tells_the_airs_temperature_in_status_and_sweeps(tmp_path, seed):
    with stepped_unit("--room", room(tmp_path, 21.0), "--seed", str(seed)) as unit:
        unit.greet()
        unit.run(FIRST_MEAN_S)
        untrimmed = temperature(unit)
        assert unit.command(Single(0)) == Outcome.DONE
        sweep = unit.receive(Sweep, 30.0)
        assert sweep.temperature == NO_TEMPERATURE
        unit.acknowledge(sweep)

        unit.run(FIRST_MEAN_S)
        assert unit.command(TrimTemperature(0, 2100)) == Outcome.DONE
        assert unit.command(Single(0)) == Outcome.DONE
        # Four sigma of the difference of two means.
        assert unit.receive(Sweep, 30.0).temperature == pytest.approx(2100, abs=40)
        assert temperature(unit) == pytest.approx(2100, abs=40)
        trim = unit.ask(AskSettings(0), Settings).temperature_trim
        assert trim == pytest.approx(2100 - untrimmed, abs=40)


def test_a_trim_that_is_stored_outlives_a_power_up():
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        unit.run(FIRST_MEAN_S)
        assert unit.command(TrimTemperature(0, 2100)) == Outcome.DONE
        settings = unit.ask(AskSettings(0), Settings)
        assert settings.stored == 0
        assert unit.command(Store(0)) == Outcome.DONE
        unit.inject("power_cut", for_s=0.5)
        unit.receive(Hello)
        again = unit.ask(AskSettings(0), Settings)
        assert (again.stored, again.temperature_trim) == (1, settings.temperature_trim)
        unit.run(FIRST_MEAN_S)
        assert temperature(unit) == pytest.approx(2100, abs=40)


@pytest.mark.parametrize("air", [-4001, 8501, 32767, -32768, 7000])
def test_a_temperature_that_no_air_has_or_no_chip_is_so_far_from_is_refused(air):
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        unit.run(FIRST_MEAN_S)
        before = temperature(unit)
        assert unit.command(TrimTemperature(0, air)) == Outcome.OUT_OF_RANGE
        assert unit.ask(AskSettings(0), Settings).temperature_trim == NO_TEMPERATURE
        assert temperature(unit) == before
