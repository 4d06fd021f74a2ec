"""The commands of noctule-viewer: what they refuse, and what they say where there is no screen."""

import re
from pathlib import Path

import pytest
from viewer.relay_rig import run_viewer

from noctule_viewer import memory_limit
from noctule_viewer.cli.recordings import native_viewer as native_viewer_command
from noctule_viewer.memory_limit import MemoryLimitError


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("run", "--port", "99999"), "it is '99999': give 65535 or less"),
        (
            ("run", "--bind", "192.0.2.1"),
            "Cannot assign requested address: name another address",
        ),
        (("open", "--url", "foo"), "foo is no relay: give rerun+http://127.0.0.1:9876/proxy"),
        (("run", "--floor-plan-at", "1,2,90"), "a floor plan belongs to a site: give --site too"),
        (("run", "--port", "9090", "--web-port", "9090"), "both 9090: give each a port of its own"),
        (("run", "--tls", "viewer"), "--tls is for the bus, on which a site is watched: give --site too"),
        (("days", "no_such_folder"), "there are no recordings in no_such_folder: noctule-viewer run --record"),
    ],
)
def test_what_no_relay_can_be_is_refused_in_one_line(arguments: tuple[str, ...], told: str) -> None:
    ended = run_viewer(*arguments)
    assert ended.returncode in (1, 2)
    assert told in " ".join(ended.stderr.split()) and "Traceback" not in ended.stderr


@pytest.mark.parametrize(
    ("limit", "told"),
    [
        ("lots", "--memory-limit 'lots' is no amount of memory: write it like 64MB or 1GB"),
        ("64", "--memory-limit '64' is no amount of memory: write it like 64MB or 1GB"),
        ("1MB", "--memory-limit 1MB is too little to keep a map: at least 8MB"),
    ],
)
def test_a_memory_limit_that_is_none_is_refused_before_anything_is_started(limit: str, told: str) -> None:
    with pytest.raises(MemoryLimitError, match=re.escape(told)):
        memory_limit.checked(limit)


@pytest.mark.parametrize("limit", ["64MB", "8 MB", "1.5GB", "64MiB"])
def test_a_memory_limit_may_be_written_as_rerun_takes_it(limit: str) -> None:
    assert memory_limit.checked(limit) == limit


def test_where_there_is_no_screen_the_address_is_told() -> None:
    told = run_viewer("open", "--url", "rerun+http://127.0.0.1:4711/proxy")
    assert told.returncode == 0
    assert "rerun+http://127.0.0.1:4711/proxy" in told.stdout


def test_where_there_is_no_screen_what_to_do_with_a_recording_is_told(tmp_path: Path) -> None:
    recording = tmp_path / "map.rrd"
    missing = run_viewer("open", str(recording))
    assert missing.returncode == 1
    assert f"there is no file {recording}" in missing.stderr
    recording.write_bytes(b"")
    told = run_viewer("open", str(recording))
    assert told.returncode == 0
    assert (
        told.stdout == f"There is no screen here. Copy {recording} to where there is one: noctule-viewer open map.rrd\n"
    )


def test_a_native_viewer_of_a_relay_drops_the_oldest_and_one_of_a_recording_shows_all(tmp_path: Path) -> None:
    url = "rerun+http://127.0.0.1:4711/proxy"
    assert native_viewer_command([], url)[1:4] == [url, "--memory-limit", "1GB"]
    assert "--memory-limit" not in native_viewer_command([tmp_path / "map.rrd"], url)
