"""A sensor, motor, switch or button that is stuck never stops the link: the unit answers and does what it can."""

from itertools import pairwise

import pytest
from firmware.stepped_unit import SteppedUnit, stepped_unit

from noctule_gateway.wire.frames import (
    NO_WAYPOINT,
    AskClock,
    AskHello,
    AskStatus,
    Clock,
    Hello,
    NoEcho,
    Outcome,
    Start,
    State,
    Status,
    Stop,
    Sweep,
)

SENSOR = ["sensor_stuck_high", "sensor_missing", "sensor_deaf", "sensor_short_pulse", "sensor_too_early"]
MOTION = ["motor_stuck", "home_stuck_open", "home_stuck_closed"]
BUTTON = ["button_held"]
# firmware/README.md: tasks run every 2 ms; CLOCK waits for a silent line, and a sweep's 123 bytes take 11 ms of it.
ANSWERED_WITHIN_S = 0.025


def longest_wait_s(unit: SteppedUnit, duration_s: float) -> float:
    """The longest time that an answer took, of STATUS and CLOCK by turns; sweeps are sent again and again meanwhile."""
    waits = []
    end_s = unit.now_s + duration_s
    while unit.now_s < end_s:
        for enquiry, answer in ((AskStatus(0), Status), (AskClock(0), Clock)):
            at_s = unit.now_s
            unit.ask(enquiry, answer)
            waits.append(unit.now_s - at_s)
        unit.run(0.037)
    return max(waits)


@pytest.mark.parametrize("kind", [*SENSOR, *MOTION, *BUTTON])
@pytest.mark.parametrize("when_s", [0.0, 12.3], ids=["from the start", "in a sweep"])
def test_the_link_goes_on_whatever_part_is_broken(kind, when_s):
    with stepped_unit("--laps", "0") as unit:
        boot = unit.greet().boot
        if when_s == 0.0:
            unit.inject(kind)
        assert unit.command(Start(0, 0)) == Outcome.DONE
        unit.run(when_s)
        unit.inject(kind)
        assert longest_wait_s(unit, 20.0) < ANSWERED_WITHIN_S
        assert unit.command(Stop(0)) == Outcome.DONE
        unit.run(5.0)
        # It has not been reset to get there, and rests when it is told to.
        assert unit.ask(AskStatus(0), Status).state in (State.IDLE, State.FAULT)
        assert unit.ask(AskHello(0), Hello).boot == boot


@pytest.mark.parametrize(
    ("kind", "echo"),
    [
        ("sensor_stuck_high", NoEcho.STUCK_HIGH),
        ("sensor_missing", NoEcho.NO_SENSOR),
        ("sensor_deaf", NoEcho.NO_ECHO),
        ("sensor_short_pulse", NoEcho.TOO_EARLY),
        ("sensor_too_early", NoEcho.TOO_EARLY),
    ],
)
def test_sweeps_of_a_broken_sensor_say_what_is_wrong_with_it(kind, echo):
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        unit.inject(kind)
        assert unit.command(Start(0, 0)) == Outcome.DONE
        sweep = unit.receive(Sweep, 60.0)
        assert {reading.echo for reading in sweep.readings} == {echo}
        status = unit.ask(AskStatus(0), Status)
        assert status.echo_faults >= (0 if echo == NoEcho.NO_ECHO else len(sweep.readings))
        unit.inject("mended")
        for _ in range(3):
            unit.acknowledge(sweep)
            sweep = unit.receive(Sweep, 60.0)
        assert {reading.echo for reading in sweep.readings} != {echo}


def test_the_clock_of_a_unit_with_a_stuck_sensor_goes_on_evenly():
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        unit.inject("sensor_stuck_high")
        assert unit.command(Start(0, 0)) == Outcome.DONE
        offsets_s = []
        for _ in range(50):
            clock = unit.ask(AskClock(0), Clock)
            offsets_s.append(unit.now_s - clock.sent * 0.25e-6)
            unit.run(0.1)
        # From the first byte's beginning to the last one's end, and the step by which simulated time is read.
        assert all(abs(later - earlier) < 0.001 for earlier, later in pairwise(offsets_s))


def test_a_unit_with_a_stuck_button_obeys_its_host():
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        unit.inject("button_held")
        unit.wait_for_state(State.HOMING)
        unit.wait_for_state(State.IDLE)
        # Held is not pressed again.
        unit.run(5.0)
        assert unit.ask(AskStatus(0), Status).sweeps_made == 1
        assert unit.command(Start(0, 0)) == Outcome.DONE
        unit.wait_for_state(State.SWEEPING)


def test_a_button_that_is_stuck_makes_no_sweep_after_a_reset():
    with stepped_unit("--laps", "0") as unit:
        unit.inject("button_held")
        unit.greet()
        unit.run(5.0)
        status = unit.ask(AskStatus(0), Status)
        assert (status.state, status.waypoint, status.sweeps_made) == (State.IDLE, NO_WAYPOINT, 0)
        # It is pressed once it has been let go.
        unit.inject("mended")
        unit.run(0.5)
        unit.inject("button_held")
        assert unit.wait_for_state(State.HOMING).waypoint == 0
