"""Every command of firmware/README.md against the real firmware: done, busy, out of range, and done once only."""

import zlib
from dataclasses import replace
from math import radians

import pytest
from cobs import cobs
from firmware.stepped_unit import SteppedUnit, stepped_unit

from noctule.messages_pb2 import CommandRequest, SweepPlan
from noctule_gateway.wire import orders
from noctule_gateway.wire.codec import encode
from noctule_gateway.wire.frames import (
    NO_WAYPOINT,
    Ack,
    Ack2,
    AskClock,
    AskHello,
    AskSettings,
    AskStatus,
    Calibrate,
    Clock,
    Configure,
    For,
    GoTo,
    Hello,
    Home,
    HostFrame,
    Measure,
    MeasureKind,
    Order,
    Outcome,
    Rejected,
    Reset,
    Result,
    Settings,
    SetWaypoint,
    Single,
    Start,
    State,
    Status,
    Stop,
    Store,
    TrimTemperature,
)

PLAN = Configure(0, -24576, 4096, 13, 60, 600, 100, 20, 1)
# firmware/README.md: half_steps_per_turn in 1/256, -150 degrees
CALIBRATION = Calibrate(0, 1043398, 0, 0, -27307)
DEGREE = 65536 / 360

BETWEEN_SWEEPS = [PLAN, CALIBRATION, Store(0), Home(0)]
AT_REST_ONLY = [Single(0), GoTo(0, 0), Measure(0, MeasureKind.PLAY)]
ALWAYS = [Start(0, 500), SetWaypoint(0, 3), TrimTemperature(0, 2000), Stop(0), Reset(0)]


def name(order: Order) -> str:
    return type(order).__name__


def framed(content: bytes) -> bytes:
    return cobs.encode(content + zlib.crc32(content).to_bytes(4, "little")) + b"\0"


def content_of(request: HostFrame) -> bytes:
    """Type and payload."""
    return cobs.decode(encode(request)[:-1])[:-4]


def make_busy_by_the_button(unit: SteppedUnit) -> None:
    """Begins a sweep without a command."""
    unit.inject("button_held", for_s=0.2)
    unit.wait_for_state(State.HOMING)


@pytest.fixture
def unit():
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        unit.run(2.5)  # the thermometer's first mean
        yield unit


@pytest.fixture
def homed(unit):
    assert unit.command(Home(0)) == Outcome.DONE
    unit.wait_for_state(State.IDLE)
    return unit


@pytest.mark.parametrize("order", [*BETWEEN_SWEEPS, *AT_REST_ONLY, *ALWAYS], ids=name)
def test_a_unit_at_rest_does_everything(homed, order):
    assert homed.command(order) == Outcome.DONE


@pytest.mark.parametrize("order", [*BETWEEN_SWEEPS, *AT_REST_ONLY], ids=name)
def test_what_needs_rest_is_refused_during_a_sweep(homed, order):
    assert homed.command(Single(0)) == Outcome.DONE
    homed.wait_for_state(State.SWEEPING)
    assert homed.command(order) == Outcome.BUSY


@pytest.mark.parametrize("order", ALWAYS, ids=name)
def test_what_is_always_possible_is_done_during_a_sweep(homed, order):
    assert homed.command(Single(0)) == Outcome.DONE
    homed.wait_for_state(State.SWEEPING)
    assert homed.command(order) == Outcome.DONE


@pytest.mark.parametrize("order", [*BETWEEN_SWEEPS, *AT_REST_ONLY], ids=name)
def test_a_pause_is_rest_but_not_for_what_makes_a_sweep_or_turns(homed, order):
    assert homed.command(replace(PLAN, count=1)) == homed.command(Start(0, 5000)) == Outcome.DONE
    homed.wait_for_state(State.PAUSING)
    assert homed.command(order) == (Outcome.DONE if order in BETWEEN_SWEEPS else Outcome.BUSY)


@pytest.mark.parametrize("order", [*BETWEEN_SWEEPS, *AT_REST_ONLY], ids=name)
def test_a_unit_that_homes_is_busy(unit, order):
    assert unit.command(Home(0)) == Outcome.DONE
    assert unit.command(order) == Outcome.BUSY


def test_go_to_wants_a_unit_that_is_homed(unit):
    assert unit.command(GoTo(0, 0)) == Outcome.NOT_HOMED


@pytest.mark.parametrize(
    "order",
    [
        *(
            replace(PLAN, **wrong)
            for wrong in (
                {"count": 0},
                {"count": 65, "bearing_step": 0},
                {"ping_interval_ms": 28},
                {"ping_interval_ms": 1001},
                {"top_speed": 49},
                {"top_speed": 801},
                {"ramp_ms": 1001},
                {"top_speed": 501, "ramp_ms": 49},
                {"settle_ms": 1001},
                {"first_bearing": round(-148 * DEGREE) - 2},
                {"bearing_step": 4300},
                {"pings": 2},
                {"pings": 7},
            )
        ),
        *(
            replace(CALIBRATION, **wrong)
            for wrong in (
                {"half_steps_per_turn": 3800 * 256 - 1},
                {"half_steps_per_turn": 4400 * 256 + 1},
                {"backlash": 129},
                {"home": 3},
                {"home_bearing": round(-147.9 * DEGREE)},
            )
        ),
        GoTo(0, round(-148 * DEGREE) - 2),
        GoTo(0, round(148 * DEGREE) + 2),
        TrimTemperature(0, -4001),
        TrimTemperature(0, 8501),
    ],
    ids=str,
)
def test_what_no_unit_can_do_is_out_of_range_and_changes_nothing(homed, order):
    before = homed.ask(AskSettings(0), Settings)
    assert homed.command(order) == Outcome.OUT_OF_RANGE
    after = homed.ask(AskSettings(0), Settings)
    assert replace(after, request=before.request) == before
    assert homed.ask(AskStatus(0), Status).state == State.IDLE


@pytest.mark.parametrize("bearing_deg", [-148, 148])
def test_the_outermost_bearings_are_taken_as_the_gateway_orders_them(homed, bearing_deg):
    outermost = CommandRequest(
        bearing_rad=radians(bearing_deg), plan=SweepPlan(first_bearing_rad=radians(bearing_deg), count=1)
    )
    present = homed.ask(AskSettings(0), Settings)
    assert homed.command(orders.order_over("configure", outermost, present)) == Outcome.DONE
    assert homed.command(orders.order("go_to", outermost)) == Outcome.DONE


@pytest.mark.parametrize("order", [PLAN, CALIBRATION, Store(0)], ids=name)
def test_a_command_that_comes_again_when_it_could_not_be_run_again_has_the_same_answer(unit, order):
    again = replace(order, request=200)
    unit.send(again)
    answer = unit.receive(Result)
    assert answer == Result(200, order.TYPE, Outcome.DONE)
    make_busy_by_the_button(unit)
    unit.send(again)
    assert unit.receive(Result) == answer
    assert unit.command(order) == Outcome.BUSY


@pytest.mark.parametrize("order", [Single(0), GoTo(0, 9000), Home(0)], ids=name)
def test_a_command_that_makes_the_unit_busy_is_answered_again_and_not_run_again(homed, order):
    again = replace(order, request=200)
    homed.send(again)
    answer = homed.receive(Result)
    assert answer == Result(200, order.TYPE, Outcome.DONE)
    homed.send(again)
    assert homed.receive(Result) == answer
    assert homed.command(order) == Outcome.BUSY


def test_a_waypoint_that_is_set_again_by_the_same_frame_is_not_set_back(unit):
    again = SetWaypoint(200, 5)
    unit.send(again)
    unit.receive(Result)
    make_busy_by_the_button(unit)
    unit.send(again)
    unit.receive(Result)
    assert unit.ask(AskStatus(0), Status).waypoint == 6


def test_a_trim_that_comes_again_is_not_computed_again(unit):
    again = TrimTemperature(200, 2000)
    trims = []
    for _ in range(5):
        unit.send(again)
        assert unit.receive(Result).result == Outcome.DONE
        trims.append(unit.ask(AskSettings(0), Settings).temperature_trim)
        unit.run(2.5)
    assert len(set(trims)) == 1


def test_a_refusal_that_comes_again_is_the_same_though_it_could_be_done_now(homed):
    assert homed.command(Single(0)) == Outcome.DONE
    again = replace(PLAN, request=200)
    homed.send(again)
    refusal = homed.receive(Result)
    assert refusal.result == Outcome.BUSY
    homed.wait_for_state(State.IDLE)
    homed.send(again)
    assert homed.receive(Result) == refusal
    assert homed.command(PLAN) == Outcome.DONE


def test_a_store_that_comes_again_leaves_flash_alone(unit):
    took_s = []
    for _ in range(2):
        unit.send(Store(200))
        at_s = unit.now_s
        assert unit.receive(Result).result == Outcome.DONE
        took_s.append(unit.now_s - at_s)
    # Erasing alone takes 10 ms or longer; the answer of one round and 12 bytes at 115200 baud 4 ms at the most.
    assert took_s[0] > 0.010
    assert took_s[1] < 0.006


@pytest.mark.parametrize("order", [*BETWEEN_SWEEPS, *AT_REST_ONLY], ids=name)
def test_hello_makes_a_unit_forget_the_command_of_an_earlier_host(homed, order):
    homed.send(replace(order, request=200))
    homed.receive(Result)
    assert homed.ask(AskHello(0), Hello)
    homed.send(replace(order, request=200))
    second = homed.receive(Result)
    # Run again: those that made the unit busy find it so.
    busy = {Home.TYPE, Single.TYPE, GoTo.TYPE, Measure.TYPE}
    assert second.result == (Outcome.BUSY if order.TYPE in busy else Outcome.DONE)


@pytest.mark.parametrize(
    ("enquiry", "answer"),
    [(AskHello(7), Hello), (AskStatus(7), Status), (AskClock(7), Clock), (AskSettings(7), Settings)],
    ids=["hello", "status", "clock", "settings"],
)
def test_an_enquiry_is_answered_as_often_as_it_comes_whatever_the_unit_does(homed, enquiry, answer):
    assert homed.command(Single(0)) == Outcome.DONE
    homed.wait_for_state(State.SWEEPING)
    for _ in range(5):
        homed.send(enquiry)
        assert homed.receive(answer).request == 7


REQUESTS = [
    AskHello(9),
    AskStatus(9),
    AskClock(9),
    AskSettings(9),
    *(replace(order, request=9) for order in [*BETWEEN_SWEEPS, *AT_REST_ONLY, *ALWAYS]),
    Ack(1, 0, 0, 0),
    Ack2(1, 0),
    For(1, 1, replace(PLAN, request=9)),
]


@pytest.mark.parametrize("request_frame", REQUESTS, ids=name)
@pytest.mark.parametrize("change", [-1, 1])
def test_a_request_of_another_length_is_rejected_by_its_type(unit, request_frame, change):
    before = unit.ask(AskStatus(0), Status)
    content = content_of(request_frame)
    unit.send_bytes(framed(content[:change] if change < 0 else content + b"\0"))
    # firmware/README.md: reason 3, wrong length; 4, longer than any
    reason = 4 if len(content) + change > len(content_of(For(1, 1, PLAN))) else 3
    assert unit.receive(Rejected) == Rejected(reason, request_frame.TYPE)
    after = unit.ask(AskStatus(0), Status)
    assert (after.frames_bad - before.frames_bad, after.frames_unknown, after.waypoint) == (1, 0, NO_WAYPOINT)


@pytest.mark.parametrize("kind", [0x00, 0x16, 0x1F, 0x20, 0x23, 0x7F, 0x81, 0x91, 0xFF])
def test_a_type_that_is_not_in_the_table_is_rejected_as_unknown(unit, kind):
    unit.send_bytes(framed(bytes([kind, 9])))
    assert unit.receive(Rejected) == Rejected(2, kind)
    status = unit.ask(AskStatus(0), Status)
    assert (status.frames_bad, status.frames_unknown) == (0, 1)


@pytest.mark.parametrize("order", [Start(0, 500), SetWaypoint(0, 3), Single(0), replace(PLAN, count=7)], ids=name)
def test_an_order_that_names_another_unit_or_life_is_refused_and_one_that_names_this_unit_is_obeyed(unit, order):
    hello = unit.ask(AskHello(0), Hello)
    before = unit.ask(AskStatus(0), Status)
    for serial, life in ((hello.serial + 1, hello.life), (hello.serial, hello.life ^ 1)):
        unit.send(For(serial, life, replace(order, request=200)))
        assert unit.receive(Result) == Result(200, order.TYPE, Outcome.NOT_FOR_THIS_UNIT)
    after = unit.ask(AskStatus(0), Status)
    assert (after.state, after.waypoint) == (before.state, before.waypoint) == (State.IDLE, NO_WAYPOINT)
    assert unit.ask(AskSettings(0), Settings).count == PLAN.count
    unit.send(For(hello.serial, hello.life, replace(order, request=201)))
    assert unit.receive(Result) == Result(201, order.TYPE, Outcome.DONE)
    match order:
        case Start() | Single():
            unit.wait_for_state(State.HOMING)
        case SetWaypoint():
            assert unit.ask(AskStatus(0), Status).waypoint == 3
        case Configure():
            assert unit.ask(AskSettings(0), Settings).count == 7


def test_an_order_that_names_its_unit_is_obeyed_once_though_it_is_heard_twice(unit):
    hello = unit.ask(AskHello(0), Hello)
    once = For(hello.serial, hello.life, SetWaypoint(200, 3))
    unit.send(once)
    assert unit.receive(Result).result == Outcome.DONE
    unit.command(SetWaypoint(0, 4))
    unit.send(For(hello.serial, hello.life, SetWaypoint(201, 5)))
    unit.send(For(hello.serial, hello.life, SetWaypoint(201, 5)))
    assert [unit.receive(Result).request for _ in range(2)] == [201, 201]
    assert [status.waypoint for status in unit.take(Status)] in ([], [5])
    assert unit.ask(AskStatus(0), Status).waypoint == 5


def test_what_is_in_a_frame_for_this_unit_is_checked_as_any_other(unit):
    hello = unit.ask(AskHello(0), Hello)
    to = bytes([For.TYPE]) + hello.serial.to_bytes(4, "little") + hello.life.to_bytes(4, "little")
    for content, reason in ((to, 3), (to + b"\x06", 3), (to + b"\x7f\x09", 2), (to + to[:1] + b"\x09", 2)):
        unit.send_bytes(framed(content))
        assert unit.receive(Rejected) == Rejected(reason, For.TYPE)


def test_an_ack_has_no_answer(unit):
    unit.send(Ack(1, 0, 0, 0))
    unit.send(AskStatus(9))
    assert unit.receive_either(Status, Rejected).request == 9
