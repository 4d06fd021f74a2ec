"""Units that stay where they are: what the firmware makes of their plan, and the demo of a room with two of them."""

from math import degrees, dist, radians
from pathlib import Path

import pytest
from firmware.stepped_unit import SteppedUnit, stepped_unit
from rooms import site_file
from system.lockstep import CLEAN, Lockstep
from system.processes import ROOT, free_port_range, free_ports, listens, programs, wait_until
from truth import compare, load_room

from noctule.client import Client
from noctule.messages_pb2 import Contour, Sweep
from noctule.site import FixedPose, Site, load
from noctule_gateway.link.link import Link
from noctule_gateway.link.standing_orders import Wanted
from noctule_gateway.unit.plans import OWN_PLAN, wanted_plan
from noctule_gateway.wire.frames import Start, State
from noctule_gateway.wire.sweep_message import bearing_rad

TICKS_PER_S = 4e6  # firmware/README.md, "Frames"
HALF_STEP_DEG = 360 / 4075.77  # firmware/README.md, CALIBRATE
ROUNDED_DEG = 60 * 0.2 * 360 / 65536  # 60 steps of 819 parts of a turn in place of 819.2
LOUNGE = ROOT / "firmware/simulator/rooms/lounge.toml"
HEARD_BY_BOTH = ((0.0, 0.0), (0.0, 3.5))  # the corners of the walls that both units hear; the curtain is out of reach


@pytest.fixture
def lounge(tmp_path: Path) -> Site:
    """The site of the demo's lounge, as the gateway reads it."""
    path = tmp_path / "site.toml"
    path.write_text(site_file("lounge", unit_port=30_000))
    return load(path)


def served(unit: SteppedUnit, plan) -> Lockstep:
    """The unit, sweeping by ``plan`` on a sound cable."""
    link = Link(serial=1, wanted=Wanted(plan, Start(0, 0), running=True), first_request=0)
    return Lockstep(unit, link, CLEAN, seed=1)


def sweep_s(cable: Lockstep) -> float:
    """From one sweep's beginning to the next, the first sweep left out."""
    cable.wait_for(lambda: len(cable.tally.arrived) == 3, within_s=90.0)
    _, second, third = cable.tally.arrived
    return (third.start - second.start) / TICKS_PER_S


def test_a_fixed_unit_sweeps_61_bearings_in_both_directions_within_11_seconds(lounge: Site) -> None:
    with stepped_unit("--room", "lounge", "--units", "1") as unit:
        cable = served(unit, wanted_plan(lounge.unit("u1")))
        assert sweep_s(cable) < 11.0
        wanted_deg = [-135 + 4.5 * number for number in range(61)]
        for sweep in cable.tally.arrived:
            looked_deg = sorted(degrees(bearing_rad(reading.bearing)) for reading in sweep.readings)
            assert looked_deg == pytest.approx(wanted_deg, abs=HALF_STEP_DEG / 2 + ROUNDED_DEG)
        assert {sweep.readings[0].bearing < 0 for sweep in cable.tally.arrived} == {True, False}


def test_a_carried_units_sweep_takes_less_than_7_seconds() -> None:
    with stepped_unit("--room", "lounge", "--units", "1") as unit:
        assert sweep_s(served(unit, OWN_PLAN)) < 7.0


def test_a_unit_keeps_five_fine_sweeps_while_nobody_acknowledges(lounge: Site) -> None:
    plan = wanted_plan(lounge.unit("u1"))
    assert plan is not None
    with stepped_unit("--room", "lounge", "--units", "1") as unit:
        unit.greet()
        assert (unit.command(plan), unit.command(Start(0, 0))) == (0, 0)
        # firmware/README.md: a slot takes 26 + 8 * 61 bytes, rounded up to 516; 254 blocks of 12 bytes hold five.
        status = unit.wait_for_state(State.WAITING, within_s=120.0)
        assert status.sweeps_waiting == 5


def test_the_demo_of_the_lounge_maps_the_walls_that_both_its_units_hear(lounge: Site, tmp_path: Path) -> None:
    names = ("ZENOH", "RERUN", "WEB")
    ports = dict(zip(names, free_ports(len(names)), strict=True)) | {"UNIT": free_port_range(2)}
    environment = {f"DEMO_{name}_PORT": str(port) for name, port in ports.items()}
    environment |= {"ROOM": "lounge", "DEMO_DATA": str(tmp_path / "data")}
    sweeps: list[Sweep] = []
    with programs(tmp_path) as running:
        running.start("demo", "python", "deploy/demo/run.py", env=environment)
        with Client("lounge", connect=[f"tcp/127.0.0.1:{ports['ZENOH']}"]) as client:
            client.on_sweep(sweeps.append)

            def room_is_mapped() -> Contour | None:
                running.check()
                contour = client.contour()
                return contour if contour is not None and len(contour.corners) >= len(HEARD_BY_BOTH) else None

            contour = wait_until(room_is_mapped, "the walls are not mapped", within_s=240)
        running.end("demo")
    assert not any(listens(port) for port in ports.values())

    comparison = compare(contour, load_room(LOUNGE))
    assert (comparison.invented_walls, comparison.invented_corners) == (0, 0)
    found = [(corner.x_m, corner.y_m) for corner in contour.corners]
    for corner in HEARD_BY_BOTH:
        assert (
            min(dist(corner, other) for other in found) < 0.03
        )  # 2 K of air: 0.35 % of 3.6 m, and the fit's own error
    for sweep in sweeps:
        pose = lounge.unit(sweep.unit).pose
        assert isinstance(pose, FixedPose) and sweep.pose.x_m == pose.pose.x_m
        assert len(sweep.readings) == 61
        assert abs(sweep.readings[0].bearing_rad) == pytest.approx(radians(135), abs=0.01)
