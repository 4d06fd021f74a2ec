"""A client sees its site: what comes, what is, and what units answer."""

import queue
import threading
from contextlib import ExitStack

import pytest
from system.processes import PATIENCE_S, wait_until

from noctule import Client, bus, keys
from noctule.errors import BusError, KeyFormatError, NotServedError
from noctule.messages_pb2 import (
    CommandReply,
    CommandRequest,
    Contour,
    LogRecords,
    Pose,
    Reading,
    ServiceStatus,
    Sweep,
    UnitStatus,
)


@pytest.fixture
def client(open_session):
    with Client("room", session=open_session()) as client:
        yield client


def test_sweeps_come_decoded_in_order_on_one_thread_that_is_not_zenohs(client, far, collected):
    threads = set()
    client.on_sweep(lambda sweep: (threads.add(threading.current_thread().name), collected.add(sweep)))
    sweeps = [Sweep(site="room", unit="u1", log_sequence=n) for n in range(50)]
    far.publish(keys.sweep("room", "u1"), *sweeps)
    collected.wait_for(lambda came: len(came) == 50)
    assert collected == sweeps
    assert threads == {"noctule-room"}


def test_only_the_asked_for_unit_of_the_clients_own_site_comes(client, far, collected):
    client.on_sweep(collected.add, unit="u2")
    far.publish(keys.sweep("room", "u2"), Sweep(unit="u2", boot=1))
    for site, unit in (("hall", "u2"), ("room", "u1")):
        far.put(keys.sweep(site, unit), Sweep(unit=unit, boot=2).SerializeToString())
    far.publish(keys.sweep("room", "u2"), Sweep(unit="u2", boot=3))
    collected.wait_for(lambda came: len(came) == 2)
    assert collected == [Sweep(unit="u2", boot=1), Sweep(unit="u2", boot=3)]


def test_what_finds_the_queue_full_is_dropped_and_counted(open_session, far, collected):
    with Client("room", session=open_session(), queue_length=3) as client:
        arrived, go_on = threading.Event(), threading.Event()

        def slow(sweep):
            arrived.set()
            go_on.wait(PATIENCE_S)
            collected.add(sweep.log_sequence)

        subscriber = client.on_sweep(slow)
        far.publish(keys.sweep("room", "u1"), Sweep(unit="u1", log_sequence=0))
        assert arrived.wait(PATIENCE_S)
        far.publish(keys.sweep("room", "u1"), *(Sweep(unit="u1", log_sequence=n) for n in range(1, 11)))
        wait_until(lambda: client.counters()["dropped"] == 7, "not seven are dropped")
        subscriber.undeclare()
        go_on.set()
        collected.wait_for(lambda came: len(came) == 4)
    assert collected == [0, 1, 2, 3]
    assert client.counters() == {"delivered": 4, "dropped": 7, "failed": 0, "refused": 0, "newer": 0}


def test_a_callback_that_raises_is_counted_and_the_next_message_comes(client, far, collected, caplog):
    def callback(sweep):
        if sweep.log_sequence == 1:
            raise RuntimeError("not this one")
        collected.add(sweep.log_sequence)

    client.on_sweep(callback)
    far.publish(keys.sweep("room", "u1"), *(Sweep(unit="u1", log_sequence=n) for n in (1, 2)))
    collected.wait_for(len)
    assert collected == [2]
    assert client.counters()["failed"] == 1
    assert "not this one" in caplog.text


U1 = keys.sweep("room", "u1")
REFUSED = {
    "not a noctule.v1.Sweep: Error parsing": (U1, b"\xff\xff\xff"),
    "not a noctule.v1.Sweep: it has 262145 bytes": (U1, bytes(2**18 + 1)),
    "readings has 65 elements, and 64 are allowed": (U1, Sweep(unit="u1", readings=[Reading()] * 65)),
    "pose.heading_rad is 1.7e+308: give -628.319 to 628.319 rad": (
        U1,
        Sweep(unit="u1", pose=Pose(heading_rad=1.7e308)),
    ),
    "a Sweep of unit 'u2' of site '' came on a key of unit 'u1'": (U1, Sweep(unit="u2")),
    "a Sweep of unit 'u1' of site 'hall' came on a key of unit 'u1' of site 'room'": (
        U1,
        Sweep(site="hall", unit="u1"),
    ),
    "unit 'Upper' can't be part of a key": ("noctule/@v1/room/unit/Upper/sweep", Sweep(unit="u1")),
}


@pytest.mark.parametrize(("told", "put"), REFUSED.items(), ids=REFUSED)
def test_a_message_that_can_not_be_true_is_counted_and_told_once_and_the_next_comes(
    client, far, collected, caplog, told, put
):
    key, message = put
    payload = message if isinstance(message, bytes) else message.SerializeToString()
    client.on_sweep(collected.add)
    good = [Sweep(unit="u1", boot=boot) for boot in (1, 2)]
    far.publish(U1, good[0])
    for _ in range(3):
        far.put(key, payload)
    far.publish(U1, good[1])
    collected.wait_for(lambda came: len(came) == 2)
    assert collected == good
    counted = {"delivered": 2, "dropped": 0, "failed": 0, "refused": 3, "newer": 0}
    wait_until(lambda: client.counters() == counted, "not all is counted")  # the last one just after its callback
    assert [record.message for record in caplog.records if key in record.message and told in record.message] == [
        record.message for record in caplog.records
    ]
    assert len(caplog.records) == 1


def test_fields_of_a_newer_version_are_ignored_counted_told_once_and_kept(client, far, collected, caplog):
    newer = b"\xf8\x7f\x07"  # field 2047, a varint
    reading = Reading(bearing_rad=1).SerializeToString() + newer
    of_newer = Sweep(unit="u1", boot=1).SerializeToString() + bytes([13 << 3 | 2, len(reading)]) + reading
    known = Sweep(unit="u1", boot=2).SerializeToString()
    client.on_sweep(collected.add)
    far.publish(keys.sweep("room", "u1"), *(Sweep.FromString(payload) for payload in (of_newer, known, of_newer)))
    collected.wait_for(lambda came: len(came) == 3)
    assert [(sweep.boot, len(sweep.readings)) for sweep in collected] == [(1, 1), (2, 0), (1, 1)]
    assert collected[0].SerializeToString() == of_newer
    assert client.counters()["newer"] == 2
    assert [record.getMessage() for record in caplog.records] == [
        "Sweep messages have fields of a newer version, which are ignored: update this program"
    ]


def test_made_up_keys_without_number_fill_neither_log_nor_memory(client, far, collected, caplog):
    client.on_sweep(collected.add)
    far.publish(U1, Sweep(unit="u1"))
    for number in range(1500):
        far.put(keys.sweep("room", f"u{number}"), b"\xff")
    far.publish(U1, Sweep(unit="u1"))
    collected.wait_for(lambda came: len(came) == 2)
    assert client.counters()["refused"] == 1500
    assert len(caplog.records) == 1001
    assert "more than 1000 keys" in caplog.records[-1].message


def test_a_status_or_a_token_that_can_not_be_true_hides_no_other(client, far, known, collected):
    """A name of 65,536 bytes made Zenoh panic in the process that asked for that unit's log."""
    for unit, said in (("u1", "x" * 65536), ("u2", "u2")):
        bus.StatePublisher(far.session, keys.unit_status("room", unit), UnitStatus).put(UnitStatus(unit=said))
    tokens = [
        far.session.liveliness().declare_token(f"noctule/@v1/room/unit/{name}/@alive") for name in ("Upper", "u2")
    ]
    known(client.session, keys.unit_status("room", "u2"))
    assert [status.unit for status in client.unit_statuses()] == ["u2"]
    client.on_alive(lambda unit, _alive: collected.add(unit))
    collected.wait_for(len)
    assert collected == ["u2"]
    for token in tokens:
        token.undeclare()


def test_a_log_without_its_spoiled_records_is_there_for_the_asking(client, far):
    key = keys.log("room", "u1")
    sweeps = [Sweep(unit="u1", log_id="a", log_sequence=n) for n in (5, 6, 7)]
    sweeps[1].sensor.beam_width_rad = 1e-300
    records = LogRecords(log_id="a", head=9, tail=1, sweeps=sweeps)
    far.answer(key, lambda query: query.reply(key, records.SerializeToString()), client.session)
    sound = client.log("u1", 5)
    assert sound is not None and [sweep.log_sequence for sweep in sound.sweeps] == [5, 7]
    assert client.counters()["refused"] == 1


def test_a_state_comes_at_once_to_a_late_joiner_and_then_whenever_it_changes(client, far, known, collected):
    state = bus.StatePublisher(far.session, keys.contour("room"), Contour)
    known(client.session, keys.contour("room"))
    state.put(Contour(version=1))
    client.on_contour(collected.add)
    collected.wait_for(len)
    state.put(Contour(version=2))
    collected.wait_for(lambda came: came[-1].version == 2)


def test_a_present_that_is_late_does_not_come_after_what_is_newer(client, far, collected):
    key = keys.contour("room")
    asked: queue.Queue = queue.Queue()
    far.answer(key, asked.put, client.session)
    joining = threading.Thread(target=client.on_contour, args=(collected.add,))
    joining.start()
    query = asked.get(timeout=PATIENCE_S)
    far.publish(key, Contour(version=2))
    collected.wait_for(len)
    query.reply(key, Contour(version=1).SerializeToString())
    query.drop()
    joining.join()
    far.publish(key, Contour(version=3))
    collected.wait_for(lambda came: came[-1].version == 3)
    assert [contour.version for contour in collected] == [2, 3]


def test_a_poses_unit_is_told_with_it(client, open_session, collected):
    client.on_pose(lambda unit, pose: collected.add((unit, pose)))
    with Client("room", session=open_session()) as tracker:
        tracker.publish_pose("u1", Pose(x_m=1.0))
        tracker.publish_pose("u2", Pose(x_m=2.0))
        collected.wait_for(lambda came: len(came) == 2)
    assert sorted(collected, key=lambda came: came[0]) == [("u1", Pose(x_m=1.0)), ("u2", Pose(x_m=2.0))]


def test_units_are_those_whose_gateway_is_there(client, far, open_session, collected):
    client.on_alive(lambda unit, alive: collected.add((unit, alive)))
    tokens = [far.session.liveliness().declare_token(keys.alive("room", unit)) for unit in ("u1", "u2")]
    collected.wait_for(lambda came: len(came) == 2)
    # Another asks: Zenoh 1.10.2 can answer a session that watches tokens with none while these are just coming in.
    with Client("room", session=open_session()) as other:
        assert other.units() == {"u1", "u2"}
        tokens[0].undeclare()
        collected.wait_for(lambda came: ("u1", False) in came)
        assert other.units() == {"u2"}


def test_the_newest_contour_and_all_statuses_are_there_for_the_asking(client, far, known):
    assert client.contour() is None
    for seconds in (5, 9, 7):  # three mappers
        contour = Contour(mapper=f"m{seconds}")
        contour.time.FromSeconds(seconds)
        bus.StatePublisher(far.session, keys.contour("room"), Contour).put(contour)
    for unit in ("u1", "u2"):
        bus.StatePublisher(far.session, keys.unit_status("room", unit), UnitStatus).put(UnitStatus(unit=unit))
    known(client.session, keys.unit_status("room", "u2"))  # declared last
    contour = client.contour()
    assert contour is not None and contour.mapper == "m9"
    assert {status.unit for status in client.unit_statuses()} == {"u1", "u2"}


def test_service_statuses_come_with_their_cursors(client, far, collected):
    client.on_service_status(collected.add)
    status = ServiceStatus(name="m1")
    status.cursors.add(unit="u1", log_id="a", log_sequence=5)
    far.publish(keys.service_status("room", "m1"), status)
    collected.wait_for(len)
    assert collected == [status]


@pytest.mark.parametrize("claimed", [{"name": "mapper-1"}, {"name": "s1", "site": "hall"}])
def test_a_service_that_says_it_is_another_is_refused(client, far, collected, claimed):
    client.on_service_status(collected.add)
    key = keys.service_status("room", "s1")
    far.publish(key, ServiceStatus(role="mapper", **claimed), ServiceStatus(name="s1", site="room"))
    collected.wait_for(lambda came: ServiceStatus(name="s1", site="room") in came)
    assert [status.name for status in collected] == ["s1"]
    assert client.counters()["refused"] == 1


def test_a_log_is_asked_by_sequence_and_number(client, far, collected):
    key = keys.log("room", "u1")

    def answer(query):
        collected.add((query.parameters.get("from"), query.parameters.get("max")))
        query.reply(key, LogRecords(log_id="a", head=9).SerializeToString())

    far.answer(key, answer, client.session)
    assert client.log("u1", 5, max=7) == LogRecords(log_id="a", head=9)
    assert collected == [("5", "7")]
    assert client.log("u2", 1) is None


def test_a_contour_that_was_published_during_an_outage_comes_when_the_bus_is_back(endpoint, collected, known):
    with ExitStack() as closing:

        def joined(**ends):
            return closing.enter_context(bus.open_session(**ends))

        router = joined(listen=[endpoint])
        far, near = joined(connect=[endpoint]), joined(connect=[endpoint])
        state = bus.StatePublisher(far, keys.contour("room"), Contour)
        state.put(Contour(version=1))
        known(near, keys.contour("room"))
        client = closing.enter_context(Client("room", session=near))
        client.on_contour(collected.add)
        collected.wait_for(len)
        router.close()
        state.put(Contour(version=2))  # nobody hears it
        joined(listen=[endpoint])
        collected.wait_for(lambda came: came[-1].version == 2)
    assert [contour.version for contour in collected] == [1, 2]


def page_of(sweeps, query, head):
    """What a gateway's log answers, two records at the most."""
    first = int(query.parameters.get("from"))
    most = min(int(query.parameters.get("max")), 2)
    found = [sweep for sweep in sweeps if first <= sweep.log_sequence][:most]
    return LogRecords(log_id="a", head=head, tail=3, sweeps=found).SerializeToString()


def test_a_units_history_is_read_page_by_page_past_a_page_that_is_refused_as_a_whole(client, far):
    key = keys.log("room", "u1")
    sweeps = [Sweep(unit="u1", log_id="a", log_sequence=n) for n in range(3, 10)]
    for spoiled in sweeps[2:4]:  # 5 and 6, a page
        spoiled.sensor.beam_width_rad = 1e-300
    far.answer(key, lambda query: query.reply(key, page_of(sweeps, query, 9)), client.session)
    assert [sweep.log_sequence for sweep in client.history("u1")] == [3, 4, 7, 8, 9]
    assert [sweep.log_sequence for sweep in client.history("u1", 8)] == [8, 9]
    assert list(client.history("u1", 10)) == []


def test_a_history_that_nobody_has_or_whose_gateway_goes_away_is_an_error_and_not_an_end(client, far):
    with pytest.raises(NotServedError, match="no gateway serves unit 'u1'"):
        list(client.history("u1"))
    key = keys.log("room", "u1")
    sweeps = [Sweep(unit="u1", log_id="a", log_sequence=n) for n in (3, 4, 5)]

    def answer(query):
        if query.parameters.get("from") != "5":
            query.reply(key, page_of(sweeps, query, 5))

    far.answer(key, answer, client.session)
    with pytest.raises(NotServedError):
        list(client.history("u1"))


def test_that_nobody_serves_a_unit_is_said_also_where_the_folder_of_the_certificate_has_gone(open_session, tmp_path):
    with (
        Client("room", session=open_session(), tls_folder=tmp_path / "gone") as client,
        pytest.raises(NotServedError, match="no gateway serves unit 'u1'"),
    ):
        list(client.history("u1"))


def test_an_error_of_a_log_is_raised_with_its_reason(client, far):
    far.answer(keys.log("room", "u1"), lambda query: query.reply_err(b"disk full"), client.session)
    with pytest.raises(BusError, match=r"@log.*disk full"):
        client.log("u1", 1)


def test_a_command_carries_its_request_and_brings_the_reply(client, far):
    key = keys.rpc("room", "u1", "start")

    def answer(query):
        request = CommandRequest.FromString(query.payload.to_bytes())
        reply = CommandReply(request_id=request.request_id, done=request.pause_s == 2.0)
        query.reply(key, reply.SerializeToString())

    far.answer(key, answer, client.session)
    reply = client.command("u1", "start", CommandRequest(pause_s=2.0), timeout_s=PATIENCE_S)
    assert reply.done and len(reply.request_id) == 32
    assert client.command("u1", "start", CommandRequest(request_id="mine"), timeout_s=PATIENCE_S) == CommandReply(
        request_id="mine"
    )


def test_a_command_that_nobody_takes_is_told_from_one_that_takes_too_long(client, far):
    with pytest.raises(BusError, match="no gateway serves unit 'u1' of site 'room'"):
        client.command("u1", "home", CommandRequest(), timeout_s=PATIENCE_S)
    held = []
    far.answer(keys.rpc("room", "u1", "home"), held.append, client.session)
    with pytest.raises(BusError, match=r"@rpc/home: Timeout \(waited up to 0.2 s\)"):
        client.command("u1", "home", CommandRequest(), timeout_s=0.2)


def test_a_command_never_goes_to_several_units_at_once(client):
    for unit, command in (("*", "stop"), ("u$*", "stop"), ("u1", "*")):
        with pytest.raises(KeyFormatError):
            client.command(unit, command, CommandRequest(), timeout_s=PATIENCE_S)


def test_a_client_of_a_name_that_fits_no_key_is_refused_before_it_connects():
    with pytest.raises(KeyFormatError, match="site 'My Room'"):
        Client("My Room")
