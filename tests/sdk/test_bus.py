"""Sessions, states and schemas on a real router."""

import contextlib
import json
import os
import re
import socket
import threading
import traceback
from pathlib import Path

import pytest
import zenoh
from google.protobuf import message_factory
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from sdk.conftest import PATIENCE_S, Router, until_matching

from noctule import bus, bus_config, keys, metrics_server
from noctule.errors import BusConfigError, BusError
from noctule.messages_pb2 import Contour, GridTile, Sweep
from noctule_gateway.cli.options import DEFAULT_LISTEN


def test_an_encoding_names_its_message():
    assert str(bus.encoding(Sweep)) == "application/protobuf;noctule.v1.Sweep"


def test_a_client_gives_up_on_a_router_that_is_not_there_when_its_patience_ends(endpoint):
    with pytest.raises(BusError, match=f"no router answers at {endpoint}: start one"):
        bus.open_session([endpoint], patience_s=0.5)


def test_a_client_waits_for_its_router(endpoint, caplog):
    opened = []
    client = threading.Thread(target=lambda: opened.append(bus.open_session([endpoint])))
    client.start()
    with bus.open_session(listen=[endpoint]) as router:
        client.join(timeout=120)
        assert [str(zid) for zid in opened[0].info.routers_zid()] == [str(router.info.zid())]
        opened[0].close()
    assert all(endpoint in record.getMessage() for record in caplog.records)


def test_a_client_whose_first_router_is_dead_joins_the_second(router):
    with socket.socket() as nobody:  # bound and not listening: a connection is refused
        nobody.bind(("127.0.0.1", 0))
        dead = f"tcp/127.0.0.1:{nobody.getsockname()[1]}"
        with bus.open_session([dead, router.endpoint], patience_s=PATIENCE_S) as session:
            assert [str(zid) for zid in session.info.routers_zid()] == [str(router.session.info.zid())]


def test_a_client_whose_first_router_takes_connections_and_says_nothing_joins_the_second(router):
    with socket.create_server(("127.0.0.1", 0)) as silent:
        endpoint = f"tcp/127.0.0.1:{silent.getsockname()[1]}"
        with bus.open_session([endpoint, router.endpoint], patience_s=PATIENCE_S) as session:
            assert [str(zid) for zid in session.info.routers_zid()] == [str(router.session.info.zid())]


@pytest.mark.parametrize("asked", [{"connect": ["router-1:7447"]}, {"listen": ["127.0.0.1:0"]}])
def test_an_endpoint_that_is_none_is_refused_at_once_with_how_to_write_it(asked):
    with pytest.raises(BusConfigError, match="tcp/HOST:PORT"):
        bus.open_session(**asked)


def test_a_second_router_on_an_endpoint_is_told_why_it_can_not_be_one(router):
    holder = re.escape(f"is in use by {Path('/proc/self/comm').read_text().strip()} (process {os.getpid()}): stop that")
    with pytest.raises(BusError, match=f"can't be a router on {router.endpoint}: port [0-9]+ {holder}"):
        bus.open_session(listen=[router.endpoint])


def test_a_configuration_file_that_can_not_be_read_is_told(endpoint, tmp_path, monkeypatch):
    monkeypatch.setenv(bus.CONFIG_VARIABLE, str(tmp_path / "none.json5"))
    with pytest.raises(BusError, match=bus.CONFIG_VARIABLE):
        bus.open_session([endpoint])


@pytest.mark.parametrize("fault", ["oops", 'usr: "me",'])
def test_a_fault_in_a_configuration_file_is_told_by_its_line_and_not_by_what_stands_there(
    fault, endpoint, tmp_path, monkeypatch
):
    config = tmp_path / "zenoh.json5"
    config.write_text("{\n transport: { auth: { usrpwd: { FAULT password: 'hunter2' } } } }".replace("FAULT", fault))
    monkeypatch.setenv(bus.CONFIG_VARIABLE, str(config))
    with pytest.raises(BusConfigError, match=f"{config}, line 2, .*has an error") as refusal:
        bus.open_session([endpoint])
    assert "hunter2" not in "".join(traceback.format_exception(refusal.value))


def test_an_endpoints_own_configuration_which_may_hold_a_key_is_not_told(endpoint):
    with pytest.raises(BusError) as refusal:
        bus.open_session([f"{endpoint}#connect_private_key_base64=hunter2"], patience_s=0.0)
    assert "hunter2" not in str(refusal.value)


def test_a_configuration_file_gives_what_the_endpoints_do_not(endpoint, tmp_path, monkeypatch):
    config = tmp_path / "zenoh.json5"
    config.write_text('{ metadata: { name: "from the file" }, mode: "peer" }')
    monkeypatch.setenv(bus.CONFIG_VARIABLE, str(config))
    made = bus_config.config([], [endpoint], None)
    assert made.get_json("metadata") == '{"name":"from the file"}'
    assert made.get_json("mode") == '"router"'


@pytest.mark.parametrize(("connect", "listen"), [([], []), ([], [DEFAULT_LISTEN]), ([bus.DEFAULT_ROUTER], [])])
def test_nobody_is_looked_for_by_multicast_or_gossip_though_a_configuration_file_says_so(
    connect, listen, tmp_path, monkeypatch
):
    config = tmp_path / "zenoh.json5"
    config.write_text("{ scouting: { multicast: { enabled: true }, gossip: { enabled: true } } }")
    monkeypatch.setenv(bus.CONFIG_VARIABLE, str(config))
    made = bus_config.config(connect, listen, None)
    assert made.get_json("scouting/multicast/enabled") == "false"
    assert made.get_json("scouting/gossip/enabled") == "false"


def test_where_nothing_is_named_a_session_connects_to_loopback_and_listens_nowhere_and_a_router_on_loopback():
    client, router = bus_config.config([], [], None), bus_config.config([], [DEFAULT_LISTEN], None)
    assert (json.loads(client.get_json("mode")), bus_config.endpoints_of(client, "listen")) == ("client", [])
    assert bus_config.endpoints_of(client, "connect") == ["tcp/127.0.0.1:7447"]
    assert bus_config.endpoints_of(router, "listen") == ["tcp/127.0.0.1:7447"]
    assert bus_config.open_to_all(router) == ""
    assert metrics_server.address("9464") == ("127.0.0.1", 9464)


def test_a_session_is_given_up_after_its_lease_or_after_zenohs_10_s(endpoint):
    shown = "transport/link/tx/lease"
    assert bus_config.config([endpoint], [], None, lease_s=3.0).get_json(shown) == "3000"
    assert bus_config.config([endpoint], [], None).get_json(shown) == "10000"


def test_a_state_publisher_that_was_closed_answers_no_more(router):
    key = keys.contour("room")
    state = bus.StatePublisher(router.session, key, Contour)
    state.put(Contour(version=1))
    assert len(list(router.session.get(key))) == 1
    state.close()
    assert list(router.session.get(key)) == []


def test_a_late_joiner_gets_the_last_state_and_none_before_the_first(open_session, known):
    key = keys.contour("room")
    state = bus.StatePublisher(open_session(), key, Contour)
    late = open_session()
    known(late, key)
    assert list(late.get(key)) == []
    for version in (1, 2):
        state.put(Contour(site="room", version=version))
    (reply,) = late.get(key)
    assert Contour.FromString(reply.ok.payload.to_bytes()) == Contour(site="room", version=2)
    assert reply.ok.encoding == bus.encoding(Contour)


def test_a_subscriber_gets_each_state_as_it_is_put(open_session, collected):
    key = keys.contour("room")
    subscriber = open_session()
    subscriber.declare_subscriber(
        key, lambda sample: collected.add(Contour.FromString(sample.payload.to_bytes()).version)
    )
    publishing = open_session()
    until_matching(publishing.declare_publisher(key))
    state = bus.StatePublisher(publishing, key, Contour)
    for version in range(100):
        state.put(Contour(version=version))
    collected.wait_for(lambda versions: len(versions) == 100)
    assert collected == list(range(100))


def test_a_stranger_decodes_a_sweep_from_the_schema_on_the_bus(open_session, known):
    bus.declare_schemas(open_session())
    asker = open_session()
    known(asker, keys.schema("noctule.v1.Sweep"))
    (reply,) = asker.get(keys.schema("noctule.v1.Sweep"))
    assert reply.ok.encoding == bus.encoding(FileDescriptorSet)
    pool = DescriptorPool()
    for file in FileDescriptorSet.FromString(reply.ok.payload.to_bytes()).file:
        pool.Add(file)
    stranger = message_factory.GetMessageClass(pool.FindMessageTypeByName("noctule.v1.Sweep"))
    sweep = Sweep(unit="u1", log_sequence=7)
    sweep.start.FromSeconds(1_000_000_000)
    decoded = stranger.FromString(sweep.SerializeToString())
    assert (decoded.unit, decoded.log_sequence, decoded.start.seconds) == ("u1", 7, 1_000_000_000)  # pyright: ignore


def test_all_schemas_come_to_one_who_asks_for_all(open_session, known):
    bus.declare_schemas(open_session())
    asker = open_session()
    known(asker, keys.schema("*"))
    replies = asker.get(keys.schema("*"), consolidation=zenoh.ConsolidationMode.NONE)
    names = {str(reply.ok.key_expr).rsplit("/", 1)[-1] for reply in replies}
    assert {"noctule.v1.Sweep", "noctule.v1.Contour", "noctule.v1.UnitStatus", "noctule.v1.LogRecords"} <= names


def thread_count():
    return len(list(Path("/proc/self/task").iterdir()))


def test_many_states_under_one_expression_take_no_thread_each_and_those_beyond_the_limit_are_counted(
    open_session, known
):
    """A thread for each grid tile were 17,983 threads on a map of 18 km."""
    session, asker = open_session(), open_session()
    before = thread_count()
    states = bus.StatesPublisher(session, keys.grid("room"), GridTile, most=300)
    for x in range(500):
        states.put(keys.grid("room", keys.tile_name(x, 0)), GridTile(tile_x=x))
    assert thread_count() - before < 10
    assert states.refused == 200
    known(asker, keys.grid("room"))

    def asked(tile):
        replies = asker.get(keys.grid("room", tile), consolidation=zenoh.ConsolidationMode.NONE)
        return sorted(GridTile.FromString(reply.ok.payload.to_bytes()).tile_x for reply in replies)

    assert asked("*") == list(range(300))
    assert asked("7_0") == [7]
    assert asked("400_0") == []
    states.forget(keys.grid("room", "7_0"))
    assert asked("7_0") == []
    states.put(keys.grid("room", "400_0"), GridTile(tile_x=400))
    assert asked("400_0") == [400]
    assert states.refused == 199
    states.close()


def test_a_session_is_closed_though_another_thread_is_in_a_call_on_it(router: Router) -> None:
    session, ended = bus.open_session([router.endpoint]), threading.Event()

    def put() -> None:
        with contextlib.suppress(zenoh.ZError):  # it was closed
            while not ended.is_set():
                session.put("noctule/x", b"x")

    putting = [threading.Thread(target=put) for _ in range(4)]
    with bus.closing(session):
        for each in putting:
            each.start()
        ended.wait(0.1)
    ended.set()
    for each in putting:
        each.join()
    assert session.is_closed()
