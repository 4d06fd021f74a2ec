"""The gateway whole, and units of one room: those that know turns get theirs, the others are served and named."""

import time
from pathlib import Path

import zenoh
from gateway.model_unit import ModelUnit
from gateway.serving import SITE, running, site_file, unit_status
from gateway.tcp_unit import TcpUnit, tcp_unit
from system.processes import PATIENCE_S, wait_until

from noctule.client import Client
from noctule.messages_pb2 import CommandRequest, SweepPlan
from noctule_gateway.wire.frames import Start

POSE = "pose = {{ x_m = {x_m}, y_m = 0.0, heading_deg = 90 }}\nsweep = {{ start = true }}"
DRIFTS = {"u1": 0.012, "u2": -0.009}


def site(folder: Path, lines: dict[str, TcpUnit]) -> Path:
    units = [
        (name, line.unit.serial, line.address, POSE.format(x_m=place))
        for place, (name, line) in enumerate(lines.items())
    ]
    return site_file(folder, *units)


def turns(line: TcpUnit) -> tuple[float, float]:
    """One of the unit's turns in the host's monotonic time, and their period, by its true oscillator."""
    with line.lock:
        start = next(order for order in reversed(line.unit.carried_out) if isinstance(order, Start))
        now_s = time.monotonic()
        tick_s = 0.25e-6 / (1 + line.unit.drift)
        return now_s + (start.turn - line.unit.tick(now_s)) * tick_s, start.period * tick_s


def test_two_units_of_one_room_get_slots_that_are_half_a_period_apart(tmp_path: Path, router: zenoh.Session) -> None:
    born_s = time.monotonic()
    one, two = (
        ModelUnit(serial, born_s=born_s, drift=drift, knows_turns=True)
        for serial, drift in enumerate(DRIFTS.values(), 7)
    )
    with tcp_unit(one) as first, tcp_unit(two) as second:
        lines = dict(zip(DRIFTS, (first, second), strict=True))
        with running(site(tmp_path, lines), tmp_path, router), Client(SITE, session=router) as client:
            wait_until(
                lambda: all(unit_status(client, name).counters["unit_in_turn"] for name in lines), "not both have turns"
            )
            wait_until(lambda: not any(unit_status(client, name).detail for name in lines), "something is wrong")
            (turn_1_s, period_1_s), (turn_2_s, period_2_s) = turns(first), turns(second)
            # A clock with turns may be off by 1.5 x 2.6 ms (keeper.py, Turn.clock_error_s): two clocks, two sigma each.
            assert abs((turn_2_s - turn_1_s) % period_1_s - period_1_s / 2) < 0.015
            # The oscillators differ by 2.1 %. Each clock is known to 2.6 ms for the next 3 s: two sigma each again.
            assert abs(period_1_s / period_2_s - 1) < 4 * 2.6e-3 / 3


def test_units_of_older_firmware_are_served_and_named(tmp_path: Path, router: zenoh.Session) -> None:
    born_s = time.monotonic()
    with tcp_unit(ModelUnit(7, born_s=born_s)) as old, tcp_unit(ModelUnit(8, born_s=born_s, knows_turns=True)) as new:
        lines = {"u1": old, "u2": new}
        with running(site(tmp_path, lines), tmp_path, router), Client(SITE, session=router) as client:
            wait_until(lambda: unit_status(client, "u2").counters["unit_in_turn"], "the new one has no turns")
            wait_until(lambda: unit_status(client, "u1").log_head > 3, "the old one's sweeps are not logged")
            named = "its firmware knows no turns: update it"
            wait_until(lambda: unit_status(client, "u1").detail.endswith(named), "the old one is not named")
            with old.lock:
                assert all(order == Start(0, 0) for order in old.unit.carried_out if isinstance(order, Start))


def test_a_plan_given_on_the_bus_that_looks_at_another_unit_is_named(tmp_path: Path, router: zenoh.Session) -> None:
    born_s = time.monotonic()
    one, two = (ModelUnit(serial, born_s=born_s, knows_turns=True) for serial in (7, 8))
    away = "pose = {{ x_m = {x_m}, y_m = 0.0, heading_deg = 90 }}\nsweep = {{ first_bearing_deg = {first_deg}, "
    away += "bearing_step_deg = 10, count = 2, start = true }}"
    with tcp_unit(one) as first, tcp_unit(two) as second:
        path = site_file(
            tmp_path,
            ("u1", 7, first.address, away.format(x_m=-1.5, first_deg=90)),
            ("u2", 8, second.address, away.format(x_m=1.5, first_deg=-90)),
        )
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            wait_until(lambda: unit_status(client, "u1").log_head, "it is not served")
            assert "may hear its pings" not in unit_status(client, "u1").detail
            client.command("u1", "stop", CommandRequest(), timeout_s=PATIENCE_S)
            wide = SweepPlan(first_bearing_rad=-2.0, bearing_step_rad=0.4, count=11)
            assert client.command("u1", "configure", CommandRequest(plan=wide), timeout_s=PATIENCE_S).done
            client.command("u1", "start", CommandRequest(), timeout_s=PATIENCE_S)
            wait_until(lambda: "so u2 may hear its pings" in unit_status(client, "u1").detail, "it is not named")
