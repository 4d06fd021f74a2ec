"""The line to the relay: whatever becomes of the relay, put() returns at once, and viewers end up with the present."""

import json
import logging
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event
from time import monotonic

import numpy as np
import pytest
import rerun as rr
from mapper.rerun_relay import Relay, SlowLine, relay, viewer
from system.processes import wait_until

from noctule_mapper.rerun_view.address import RelayAddressError, host_and_port
from noctule_mapper.rerun_view.drawing import Drawing, Entries
from noctule_mapper.rerun_view.link import RerunLink

FLOOD = Path(__file__).with_name("rerun_flood.py")
AT_ONCE_S = 2.0  # far under the 5 s that connecting to a dead relay takes, far over what a busy machine adds


def draw_frame() -> Entries:
    yield "frame", rr.TextDocument("the frame")


def draw_text(path: str, text: str) -> Entries:
    yield path, rr.TextDocument(text)


def draw_noise(seed: int) -> Entries:
    yield "noise", rr.Image(np.random.default_rng(seed).integers(0, 255, (250, 250, 3), np.uint8))


def fault() -> Entries:
    raise ValueError("a drawing that can't be drawn")


def text(path: str, words: str, subject: str | None = None) -> Drawing:
    return Drawing(draw_text, (path, words), time_s=1_000.0, sweep=7, subject=subject)


@contextmanager
def link(url: str, capacity: int = 256, statics: Callable[[], Entries] = draw_frame) -> Iterator[RerunLink]:
    made = RerunLink(url, "paper-room", statics, capacity)
    try:
        yield made
    finally:
        made.close()


def put_s(line: RerunLink, drawing: Drawing) -> float:
    began_s = monotonic()
    line.put(drawing)
    return monotonic() - began_s


def wait_for_connections(line: RerunLink, count: int) -> None:
    wait_until(lambda: line.counters()["rerun_connections"] >= count, "no connection to the relay")


def wait_for_drawn(line: RerunLink, count: int) -> None:
    wait_until(lambda: line.counters()["rerun_drawn"] >= count, "the link does not draw", every_s=0.01)


@pytest.fixture
def far_end() -> Iterator[Relay]:
    with relay() as made:
        yield made


def test_what_is_put_reaches_a_viewer_at_its_time_and_sweep(far_end: Relay, tmp_path: Path) -> None:
    far_end.start()
    with link(far_end.url) as line, viewer(far_end.url, tmp_path) as watching:
        line.put(text("greeting", "hello"))
        (chunk,) = watching.wait_for("greeting")
        batch = chunk.to_record_batch()
        assert batch.column("TextDocument:text").to_pylist() == [["hello"]]
        assert batch.column("sweep").to_pylist() == [7]
        assert batch.column("time").to_pylist()[0].timestamp() == 1_000.0
        assert all(chunk.is_static for chunk in watching.wait_for("frame"))


def test_without_a_relay_put_returns_at_once_and_the_oldest_are_dropped_and_counted(far_end: Relay) -> None:
    with link(far_end.url, capacity=10) as line:
        assert max(put_s(line, text("greeting", str(number))) for number in range(30)) < AT_ONCE_S
        assert line.counters()["rerun_dropped"] == 20
        assert line.counters()["rerun_connections"] == 0


def test_a_relay_that_comes_late_shows_the_present_even_if_it_was_dropped_meanwhile(
    far_end: Relay, tmp_path: Path
) -> None:
    with link(far_end.url, capacity=10) as line:
        line.put(text("contour", "five walls", subject="contour"))
        for number in range(30):
            line.put(text("log", str(number)))
        far_end.start()
        with viewer(far_end.url, tmp_path) as watching:
            assert watching.values("contour", "TextDocument:text") == [["five walls"]]
            assert watching.values("log", "TextDocument:text", rows=10) == [[str(number)] for number in range(20, 30)]


def test_a_relay_that_was_killed_and_started_again_shows_the_present_and_what_follows(
    far_end: Relay, tmp_path: Path
) -> None:
    far_end.start()
    with link(far_end.url) as line:
        line.put(text("contour", "five walls", subject="contour"))
        wait_for_connections(line, 1)
        far_end.kill()
        assert max(put_s(line, text("lost", str(number))) for number in range(100)) < AT_ONCE_S
        far_end.start()
        wait_for_connections(line, 2)
        line.put(text("log", "back again"))
        with viewer(far_end.url, tmp_path) as watching:
            for path in ("contour", "frame", "log"):
                watching.wait_for(path)


def test_what_stands_is_drawn_again_before_a_relay_of_little_memory_forgets_it(tmp_path: Path) -> None:
    with relay("8MB") as far_end:
        far_end.start()
        with link(far_end.url, capacity=10) as line:
            line.put(text("contour", "five walls", subject="contour"))
            line.put(Drawing(draw_noise, (0,), time_s=0.0, sweep=0))
            wait_for_drawn(line, 2)
            for number in range(1, 100):  # 190 kB each, which no compression makes smaller
                line.put(Drawing(draw_noise, (number,), time_s=float(number), sweep=number))
                wait_for_drawn(line, 2 + number)
            with viewer(far_end.url, tmp_path) as watching:
                assert watching.values("contour", "TextDocument:text")[-1] == ["five walls"]
                wait_until(lambda: 99 in watching.values("noise", "sweep"), "the newest noise does not come")
                frames = sum(chunk.num_rows for chunk in watching.seen()["noise"])
    assert frames < 50, "the relay has forgotten nothing, so that this shows nothing"


def test_a_slow_relay_holds_up_the_worker_alone_and_gets_the_present_once_it_is_faster(
    far_end: Relay, tmp_path: Path
) -> None:
    far_end.start()
    slow = SlowLine(far_end.port, bytes_per_s=100_000)
    try:
        with link(f"rerun+http://127.0.0.1:{slow.port}/proxy", capacity=20) as line:
            wait_for_connections(line, 1)
            line.put(text("contour", "five walls", subject="contour"))
            slowest_s, seed, pause = 0.0, 0, Event()
            while line.counters()["rerun_stalls"] == 0 or line.counters()["rerun_dropped"] == 0:
                drawing = Drawing(draw_noise, (seed,), time_s=float(seed), sweep=seed, subject="noise")
                slowest_s, seed = max(slowest_s, put_s(line, drawing)), seed + 1
                pause.wait(0.01)
            assert slowest_s < AT_ONCE_S
            line.put(text("contour", "six walls", subject="contour"))
            slow.widen()
            with viewer(far_end.url, tmp_path) as watching:
                wait_until(lambda: ["six walls"] in watching.values("contour", "TextDocument:text"), "no new contour")
    finally:
        slow.close()


@pytest.mark.parametrize(
    ("frozen_s", "drawings_per_s"),
    [(15, 50), pytest.param(60, 13, marks=pytest.mark.soak)],  # 13: four units at 0.3 s a sweep
)
def test_a_frozen_relay_costs_the_drawing_process_little_memory_and_shows_the_present_once_it_goes_on(
    far_end: Relay, tmp_path: Path, frozen_s: int, drawings_per_s: int
) -> None:
    far_end.start()
    command = [sys.executable, FLOOD, far_end.url, str(frozen_s), str(drawings_per_s)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as flood:
        assert flood.stdin is not None and flood.stdout is not None
        assert flood.stdout.readline() == "connected\n"
        far_end.freeze()
        flood.stdin.write("\n")
        flood.stdin.flush()
        found = json.loads(flood.stdout.readline())
        far_end.thaw()
        with viewer(far_end.url, tmp_path) as watching:
            wait_until(lambda: [str(found["last"])] in watching.values("number", "TextDocument:text"), "no last number")
    assert found["rerun_stalls"] > 0
    # 50 MB is the whole mapper's allowance; an SDK that was given everything held 120 MB after the short version.
    assert found["grew_bytes"] < 25e6


def test_an_error_in_the_link_itself_is_reported_and_drawing_goes_on(
    far_end: Relay, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    attempts = []

    def draw_frame_at_second_attempt() -> Entries:
        attempts.append(None)
        if len(attempts) == 1:
            raise ValueError("no frame yet")
        yield from draw_frame()

    far_end.start()
    with link(far_end.url, statics=draw_frame_at_second_attempt) as line, viewer(far_end.url, tmp_path) as watching:
        line.put(text("contour", "five walls", subject="contour"))
        watching.wait_for("contour")
        assert line.counters()["rerun_failures"] == 1
    assert "drawing was interrupted by ValueError('no frame yet'): trying again" in caplog.text


def test_a_drawing_that_keeps_failing_is_logged_once(far_end: Relay, caplog: pytest.LogCaptureFixture) -> None:
    far_end.start()
    with link(far_end.url) as line:
        for _ in range(20):
            line.put(Drawing(fault, (), time_s=0.0, sweep=0, subject="contour"))
        wait_until(lambda: line.counters()["rerun_failures"] == 20, "not all were tried")
    errors = [record for record in caplog.records if record.levelno == logging.ERROR]
    assert [record.getMessage() for record in errors] == ["can't draw contour: viewers miss it, mapping goes on"]


def test_a_drawing_that_fails_is_counted_and_the_next_is_drawn(far_end: Relay, tmp_path: Path) -> None:
    far_end.start()
    with link(far_end.url) as line, viewer(far_end.url, tmp_path) as watching:
        line.put(Drawing(fault, (), time_s=0.0, sweep=0))
        line.put(text("greeting", "still here"))
        watching.wait_for("greeting")
        assert line.counters()["rerun_failures"] == 1


def test_closing_does_not_wait_for_a_relay_that_is_not_there(far_end: Relay) -> None:
    line = RerunLink(far_end.url, "paper-room", draw_frame)
    line.put(text("greeting", "nobody hears"))
    began_s = monotonic()
    line.close()
    assert monotonic() - began_s < 3.0


def test_a_relay_at_no_port_is_refused() -> None:
    with pytest.raises(RelayAddressError, match="port 99999 is none: give 1 to 65535"):
        host_and_port("rerun+http://127.0.0.1:99999/proxy")


@pytest.mark.parametrize("url", ["127.0.0.1:9876", "http://127.0.0.1:9876/proxy", "rerun+http://127.0.0.1/proxy"])
def test_an_address_that_is_no_relays_is_refused(url: str) -> None:
    with pytest.raises(RelayAddressError, match="should read rerun\\+http://HOST:PORT/proxy, with #sites behind it"):
        RerunLink(url, "paper-room", draw_frame)
