"""Sweeps recorded and replayed by the command noctule."""

import signal
import time

import pytest
from sdk.conftest import Collected, finish, sweeps

from noctule import Client, bus, keys, survey
from noctule.messages_pb2 import (
    ServiceStatus,
)


@pytest.mark.parametrize("name", ["out.jsonl", "out.mcap"])
def test_record_goes_on_where_the_file_ends(site, noctule, tmp_path, name):
    out = tmp_path / name
    journal = out if out.suffix == ".jsonl" else tmp_path / "out.mcap.jsonl"
    for total, new in ((3, 3), (5, 2)):
        process = noctule("record", "room", out)
        lines = total if journal == out else new
        while process.poll() is None and (not journal.exists() or journal.read_bytes().count(b"\n") < lines):
            time.sleep(0.02)  # a file tells nobody that it has grown
        process.send_signal(signal.SIGINT)
        code, _, err = finish(process)
        assert code == 0, err
        site.run(sweeps(2), None)
    assert [sweep.log_sequence for sweep in survey.read(out)] == [1, 2, 3, 4, 5]


def test_replay_is_the_router_itself_and_ends_when_its_readers_have_read_it(noctule, endpoint, survey_file, collected):
    process = noctule(
        "replay", survey_file, "--site", "room", "--speed", "max", "--listen", endpoint, "--exit-when-done"
    )
    with Client("room", [endpoint]) as client:
        client.on_alive(lambda unit, _alive: collected.add(unit))
        collected.wait_for(len)
        records = client.log("u1", 1)
        assert records is not None
        assert [sweep.log_sequence for sweep in records.sweeps] == [1, 2, 3]
        status = ServiceStatus(name="mapper")
        status.cursors.add(unit="u1", log_id=records.log_id, log_sequence=3)
        shown = bus.StatePublisher(client.session, keys.service_status("room", "mapper"), ServiceStatus)
        shown.put(status)
        assert finish(process)[0] == 0


def test_replay_fails_when_nobody_reads_it_in_time(noctule, endpoint, survey_file):
    command = ("replay", survey_file, "--site", "room", "--speed", "1000", "--listen", endpoint)
    code, _, err = finish(noctule(*command, "--exit-when-done", "--timeout", 0.2))
    assert code == 1 and "after 0.2 s no service shows that it has read all" in err


@pytest.mark.parametrize("speed", ["0", "-1", "nan", "fast"])
def test_replay_refuses_a_speed_that_is_none(noctule, survey_file, speed):
    code, _, err = finish(noctule("replay", survey_file, "--site", "room", "--speed", speed))
    assert code == 2 and "is neither a number above 0 nor max" in err


@pytest.mark.usefixtures("site")
def test_replay_refuses_a_unit_that_somebody_serves_before_it_publishes_another(far, noctule, tmp_path):
    first, second = sweeps(2)
    first.unit = "u9"
    with (tmp_path / "both.jsonl").open("w") as stream:
        survey.write([first, second], stream)
    published = Collected()
    with far.session.declare_subscriber(keys.sweep("room", "u9"), published.add):
        code, _, err = finish(noctule("replay", tmp_path / "both.jsonl", "--site", "room"))
    assert code == 1 and "unit 'u1' of site 'room' is served already: replay it as another site" in err
    assert published == []
