"""What the tests of the bus share: a real router on a free port, sessions that get closed, things to wait on."""

import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest
import zenoh
from google.protobuf.message import Message
from sdk.followed import POLL_S
from system.processes import PATIENCE_S, free_ports, wait_until

from noctule import Client, LogFollower, bus, keys, survey
from noctule.messages_pb2 import (
    POSE_STATE_OPEN,
    Contour,
    Pose,
    Reading,
    Sweep,
    Touch,
    UnitPose,
    Wall,
)
from noctule.replay import Replay

NOCTULE = (sys.executable, "-c", "from noctule.__main__ import program; program()")


class Collected(list[Any]):
    """What callbacks brought, in order, and a way to wait for it."""

    def __init__(self) -> None:
        super().__init__()
        self._changed = threading.Condition()

    def add(self, item: Any) -> None:
        """A callback."""
        with self._changed:
            self.append(item)
            self._changed.notify_all()

    def add_all(self, items: Any) -> None:
        """A callback that brings several."""
        with self._changed:
            self.extend(items)
            self._changed.notify_all()

    def wait_for(self, condition: Callable[["Collected"], bool]) -> None:
        """Wait until ``condition`` holds of what has come."""
        with self._changed:
            assert self._changed.wait_for(lambda: condition(self), PATIENCE_S), f"only {len(self)} came: {self[-3:]}"


class Router:
    """A router in this process."""

    def __init__(self, endpoint: str) -> None:
        self.endpoint = endpoint
        self.session = bus.open_session(listen=[endpoint])

    def stop(self) -> None:
        """Cut all its links."""
        self.session.close()


class FarEnd:
    """Those on the other side of the bus. What they declare takes a moment to be known; they wait for that."""

    def __init__(self, session: zenoh.Session) -> None:
        self.session = session

    def publish(self, key: str, *messages: Message) -> None:
        """Publish to a subscriber, when the bus knows of one."""
        publisher = bus.declare_publisher(self.session, key, type(messages[0]))
        until_matching(publisher)
        for message in messages:
            publisher.put(message.SerializeToString())
        publisher.undeclare()

    def put(self, key: str, payload: bytes) -> None:
        """Publish bytes as they are. The put waits while a link is busy; Zenoh's default drops the bytes."""
        self.session.put(key, payload, congestion_control=zenoh.CongestionControl.BLOCK)

    def answer(self, key: str, callback: Callable[[zenoh.Query], Any], asker: zenoh.Session) -> None:
        """Answer queries, and wait until ``asker`` can ask."""
        self.session.declare_queryable(key, callback)
        until_answered(asker, key)


def until_answered(asker: zenoh.Session, key: str) -> None:
    """Wait until ``asker`` knows of one who answers queries on ``key``."""
    querier = asker.declare_querier(key)
    until_matching(querier)
    querier.undeclare()


def until_matching(declared: zenoh.Publisher | zenoh.Querier) -> None:
    """Wait until one who is there for it is known."""
    matching = threading.Event()
    listener = declared.declare_matching_listener(lambda status: matching.set() if status.matching else None)
    status: Any = declared.matching_status  # its annotation is wrong in Zenoh 1.10.2
    assert status.matching or matching.wait(PATIENCE_S), f"nobody on {declared.key_expr}"
    listener.undeclare()


@pytest.fixture
def endpoint() -> str:
    """An endpoint on the loopback that is free."""
    return f"tcp/127.0.0.1:{free_ports(1)[0]}"


@pytest.fixture
def router(endpoint: str) -> Iterator[Router]:
    """A running router."""
    router = Router(endpoint)
    yield router
    router.stop()


@pytest.fixture
def open_session(router: Router) -> Iterator[Callable[[], zenoh.Session]]:
    """Opens sessions on the router."""
    sessions: list[zenoh.Session] = []

    def open_one() -> zenoh.Session:
        sessions.append(bus.open_session([router.endpoint]))
        return sessions[-1]

    yield open_one
    for session in sessions:
        session.close()


@pytest.fixture
def follow(open_session):
    """Starts a follower with a client of its own that stores into a store; returns it."""
    running = []

    def start(store, poll_s=POLL_S):
        client = Client("room", session=open_session())
        follower = LogFollower(client, store.deliver, dict(store.cursors), poll_s)
        follower.start()
        running.append((follower, client))
        return follower

    yield start
    for follower, client in running:
        follower.close()
        client.close()


@pytest.fixture
def far(open_session: Callable[[], zenoh.Session]) -> FarEnd:
    """The other side of the bus."""
    return FarEnd(open_session())


@pytest.fixture
def known() -> Callable[[zenoh.Session, str], None]:
    """Waits until a session knows of one who answers queries on a key."""
    return until_answered


@pytest.fixture
def collected() -> Collected:
    """An empty collection."""
    return Collected()


# ---- The command noctule, and a site that it is asked about


def sweeps(count=3):
    for n in range(count):
        echo = Reading(bearing_rad=0.5, time_of_flight_s=0.01)
        sweep = Sweep(site="room", unit="u1", log_id="a", log_sequence=n + 1, readings=[echo, Reading()])
        sweep.start.FromMilliseconds(1_000_000 + n)
        yield sweep


@pytest.fixture
def survey_file(tmp_path):
    path = tmp_path / "survey.jsonl"
    with path.open("w") as stream:
        survey.write(sweeps(), stream)
    return path


@pytest.fixture
def site(far, router):
    """A site with one unit that has swept three times, and a contour."""
    schemas = bus.declare_schemas(far.session)
    contour = bus.StatePublisher(far.session, keys.contour("room"), Contour)
    unknown = UnitPose(unit="u2", stated=Pose(sigma_position_m=100), state=POSE_STATE_OPEN, detail="parallel walls")
    walls = [Wall(rho_m=1.5), Wall(rho_m=2, chance=0.997)]
    contour.put(Contour(site="room", version=1, walls=walls, touches=[Touch()], sweeps=3, poses=[unknown]))
    replay = Replay(far.session, "room")
    replay.run(sweeps(), None)
    tokens = router.session.liveliness()
    wait_until(lambda: list(tokens.get(keys.alive("room", "u1"))), "the router does not know of the unit")
    yield replay
    replay.close()
    contour.close()
    schemas.undeclare()


@pytest.fixture
def start(endpoint):
    """Starts the command; whatever still runs at the end is killed."""
    running = []

    def start(*command, stdin=None, stdout=subprocess.PIPE):
        environment = os.environ | {"NOCTULE_CONNECT": endpoint, "COLUMNS": "200", "PYTHONUNBUFFERED": "1"}
        running.append(
            subprocess.Popen(command, env=environment, stdin=stdin, stdout=stdout, stderr=subprocess.PIPE, text=True)
        )
        return running[-1]

    yield start
    for process in running:
        process.kill()
        process.communicate()


@pytest.fixture
def noctule(start):
    return lambda *arguments: start(*NOCTULE, *map(str, arguments))


def finish(process):
    out, err = process.communicate(timeout=PATIENCE_S)
    return process.returncode, out, err


def line_with(process, text):
    """The first line of output that holds ``text``; the test's own timeout ends the wait."""
    for line in process.stdout:
        if text in line:
            return line
    raise AssertionError(f"it ended without {text!r}: {process.stderr.read()}")
