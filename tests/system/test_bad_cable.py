"""The link and the real firmware on a cable that spoils one byte in twenty and is pulled out every ten minutes.

At that rate a frame of n bytes comes through intact with a chance of 0.95^n: a sweep of the default plan's 13 readings,
137 bytes on the line, one time in 1,130. So the unit sweeps by a plan that such a line can carry. A sweep of 3 readings
takes 57 bytes, one try in 19, and its acknowledgement 21, one in 3: 57 tries of 0.2 s, so the line carries a sweep in
11.3 s while it is plugged in, which is 10 minutes of 11, and in 12.5 s on the whole. The unit makes one each 13 s: 276
an hour, of which the tests want nine tenths.
"""

from dataclasses import replace
from random import Random

import pytest
from firmware.stepped_unit import stepped_unit
from gateway.bad_line import Faults
from system.lockstep import CLEAN, Lockstep

from noctule_gateway.link.link import Link
from noctule_gateway.link.standing_orders import Wanted
from noctule_gateway.unit.plans import OWN_PLAN
from noctule_gateway.wire.frames import Start, Stop

ONE_IN_TWENTY = Faults(corrupted=0.05)
PULLED_EVERY_S = 600.0
HOUR_S = 3600.0


def survey(duration_s: float, readings: int, pause_ms: int, seed: int) -> int:
    """Sweep for so long and check what has come of it; the number of sweeps."""
    wanted = Wanted(replace(OWN_PLAN, count=readings), Start(0, pause_ms), running=True)
    link = Link(serial=1, wanted=wanted, first_request=0)
    random = Random(seed)
    with stepped_unit("--laps", "0") as unit:
        cable = Lockstep(unit, link, ONE_IN_TWENTY, seed)
        while unit.now_s < duration_s:
            cable.run(PULLED_EVERY_S)
            cable.pull(random.uniform(1.0, 120.0))
        cable.spoil(CLEAN)
        cable.run(10.0)
        cable.carry_out(Stop(0), within_s=10.0)
        status = cable.drained(within_s=60.0)

    made = cable.tally.made
    assert link.counts.frames_bad > link.counts.frames_read  # a bad line indeed
    assert status.sweeps_made == len(made)
    assert [sequence for _, sequence in made] == list(range(len(made)))
    assert cable.tally.arrived == list(made.values())
    return len(made)


def test_for_half_an_hour_no_sweep_is_lost_doubled_or_wrong() -> None:
    assert survey(0.5 * HOUR_S, readings=3, pause_ms=12000, seed=1) > 0.5 * 0.9 * 276


def test_with_a_ring_that_is_full_all_the_time_no_sweep_is_lost_doubled_or_wrong() -> None:
    # 63 sweeps of one reading fill the ring in 10 s, and at 3 s each it takes as long to go round as an outage.
    assert survey(0.3 * HOUR_S, readings=1, pause_ms=0, seed=2) > 240


@pytest.mark.soak
@pytest.mark.timeout(1800)
def test_for_eight_hours_no_sweep_is_lost_doubled_or_wrong() -> None:
    assert survey(8 * HOUR_S, readings=3, pause_ms=12000, seed=3) > 8 * 0.9 * 276
