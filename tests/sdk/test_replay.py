"""A replayed survey looks like units that sweep now, to any reader."""

import random
import threading
from time import monotonic

import pytest
from system.processes import PATIENCE_S, wait_until

from noctule import Client, LogFollower, bus, keys, survey, survey_mcap
from noctule.errors import SurveyError
from noctule.messages_pb2 import CommandRequest, Reading, ServiceStatus, Sweep, UnitStatus
from noctule.replay import Readers, Replay


def survey_of(*units, count=20, interval_ms=50):
    for n in range(count):
        for unit in units:
            sweep = Sweep(
                site="old",
                unit=unit,
                log_id="old",
                log_sequence=90 + n,
                boot=4,
                readings=[Reading(bearing_rad=n / 1000)],
            )
            sweep.start.FromMilliseconds(1_000_000 + n * interval_ms)
            yield sweep


@pytest.fixture
def client(open_session):
    with Client("room", session=open_session()) as client:
        yield client


@pytest.fixture
def replay(open_session):
    replay = Replay(open_session(), "room")
    yield replay
    replay.close()


def test_a_follower_has_the_whole_survey_under_the_new_site_and_log(client, replay, collected):
    follower = LogFollower(client, collected.add_all, {})
    follower.start()
    replay.run(survey_of("u1", "u2", count=700), None)
    collected.wait_for(lambda came: len(came) == 1400)
    follower.close()
    for unit in ("u1", "u2"):
        got = [sweep for sweep in collected if sweep.unit == unit]
        head = replay.heads()[unit]
        assert [sweep.log_sequence for sweep in got] == list(range(1, 701))
        assert {(sweep.site, sweep.log_id, sweep.boot) for sweep in got} == {("room", head.log_id, 4)}
        assert [sweep.start.ToMilliseconds() for sweep in got] == [1_000_000 + n * 50 for n in range(700)]
        assert [sweep.readings[0].bearing_rad for sweep in got] == [n / 1000 for n in range(700)]


def test_an_mcap_recording_is_replayed_bit_for_bit_but_for_site_and_log(client, replay, collected, tmp_path):
    dice = random.Random(7)
    recorded = list(survey_of("u1", "u2"))
    for sweep in recorded:
        sweep.clock_error_s, sweep.readings[0].time_of_flight_s = dice.random(), dice.random() / 50
    path = tmp_path / "survey.mcap"
    with path.open("wb") as stream:
        survey_mcap.write(recorded, stream)
    with LogFollower(client, collected.add_all, {}):
        replay.run(survey.read(path), None)
        collected.wait_for(lambda came: len(came) == 40)
    for unit in ("u1", "u2"):
        came = [sweep for sweep in collected if sweep.unit == unit]
        for sequence, sweep in enumerate(came):
            sweep.site, sweep.log_id, sweep.log_sequence = "old", "old", 90 + sequence
        expected = [sweep.SerializeToString() for sweep in recorded if sweep.unit == unit]
        assert [sweep.SerializeToString() for sweep in came] == expected


def test_a_survey_is_replayed_at_its_pace_times_the_speed(replay):
    began_s = monotonic()
    replay.run(survey_of("u1", count=5, interval_ms=100_000), 1000.0)
    assert (
        0.4 <= monotonic() - began_s < 40.0
    )  # four hundred seconds' worth at a thousand times the speed, and not at a tenth of it or ten times that


@pytest.mark.parametrize("set_s", [14 * 86400, -14 * 86400])
def test_a_survey_over_which_the_clock_was_set_is_replayed_without_a_wait_for_that(replay, set_s):
    sweeps = list(survey_of("u1", count=6, interval_ms=100))
    for number, sweep in enumerate(sweeps):
        sweep.clock_epoch = "after" if number >= 3 else "before"
        sweep.start.seconds += 2 * 14 * 86400 + (set_s if number >= 3 else 0)
    done, began_s = threading.Event(), monotonic()
    threading.Thread(target=lambda: (replay.run(sweeps, 1.0), done.set()), daemon=True).start()
    assert done.wait(PATIENCE_S)
    assert monotonic() - began_s >= 0.4  # 0.2 s on either side of the set


def test_a_sweep_without_a_start_has_no_pace(replay):
    with pytest.raises(SurveyError, match="sweep 1 of the survey has no start: replay it at speed max"):
        replay.run([Sweep(unit="u1")], 1.0)
    replay.run([Sweep(unit="u1")], None)
    assert replay.heads()["u1"].log_sequence == 1


def test_a_replayed_unit_is_alive_has_a_status_and_answers_that_it_takes_no_commands(client, replay, known):
    replay.run(survey_of("u1", count=3), None)
    known(client.session, keys.rpc("room", "u1", "home"))
    known(client.session, keys.unit_status("room", "u1"))
    (status,) = client.unit_statuses()
    assert (status.state, status.log_tail, status.log_head, status.boot) == (UnitStatus.STATE_IDLE, 1, 3, 4)
    assert client.units() == {"u1"}
    reply = client.command("u1", "home", CommandRequest(), PATIENCE_S)
    assert not reply.done and "unit 'u1' is a replayed survey" in reply.error
    hello = client.command("u1", "hello", CommandRequest(), PATIENCE_S)
    assert hello.done and hello.status.log_id == status.log_id


def test_a_replayed_unit_sweeps_until_its_survey_is_at_its_end(client, replay, known):
    def state():
        known(client.session, keys.rpc("room", "u1", "hello"))
        return client.command("u1", "hello", CommandRequest(), PATIENCE_S).status.state

    def asked_before_the_third(sweeps):
        for number, sweep in enumerate(sweeps, start=1):
            if number == 3:
                meanwhile.append(state())
            yield sweep

    meanwhile = []
    replay.run(asked_before_the_third(survey_of("u1", count=3)), None)
    assert (meanwhile, state()) == ([UnitStatus.STATE_SWEEPING], UnitStatus.STATE_IDLE)


def test_a_replayed_unit_refuses_a_command_to_several_units(client, replay, known):
    replay.run(survey_of("u1", count=1), None)
    known(client.session, keys.rpc("room", "u1", "hello"))
    (reply,) = client.session.get(keys.rpc("room", keys.ANY, "hello"), payload=CommandRequest().SerializeToString())
    assert reply.ok is None and b"unit '*'" in reply.err.payload.to_bytes()


def test_a_log_query_that_is_not_one_gets_an_error(client, replay, known):
    replay.run(survey_of("u1", count=1), None)
    known(client.session, keys.log("room", "u1"))
    (reply,) = client.session.get(keys.log("room", "u1") + "?from=begin")
    assert b"is not from=N;max=M" in reply.err.payload.to_bytes()


def test_the_replay_is_read_when_every_reader_shows_its_head(client, replay, open_session):
    readers = Readers(client)
    replay.run(survey_of("u1", "u2", count=3), None)
    heads = replay.heads()
    session = open_session()
    states = {
        name: bus.StatePublisher(session, keys.service_status("room", name), ServiceStatus) for name in ("m1", "m2")
    }

    def show(name, **sequences):
        status = ServiceStatus(name=name)
        for unit, sequence in sequences.items():
            status.cursors.add(unit=unit, log_id=heads[unit].log_id, log_sequence=sequence)
        states[name].put(status)

    assert not readers.have_passed(heads)
    show("m1", u1=3)
    assert not readers.have_passed(heads)  # nobody has shown u2
    show("m1", u1=3, u2=3)
    wait_until(lambda: readers.have_passed(heads), "that all have read all")
    show("m2", u1=2)
    late = threading.Thread(target=lambda: show("m2", u1=3))
    late.start()
    wait_until(lambda: readers.have_passed(heads), "that all have read all")
    late.join()
