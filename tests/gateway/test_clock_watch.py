"""The host's wall clock is set: that is shown for a while, and the times after it bear another mark."""

import time
from pathlib import Path
from threading import Thread

import pytest
from sdk.host_clocks import DAY_S, Host

from noctule.elapsed import Instant
from noctule_gateway.clock.clock_watch import SHOWN_S, ClockWatch


@pytest.fixture
def kept(tmp_path: Path) -> Path:
    return tmp_path / "clock-epoch.json"


@pytest.mark.parametrize("set_s, way", [(40 * DAY_S, "forward"), (-40 * DAY_S, "back"), (10.0, "forward")])
def test_a_clock_that_is_set_is_told_once_and_shown_for_a_while(kept: Path, set_s: float, way: str) -> None:
    host = Host()
    watch = ClockWatch(kept, host)
    before = watch.look()
    host.pass_time(1.0)
    assert (watch.look().epoch, watch.sets, watch.detail) == (before.epoch, 0, "")
    host.utc_s += set_s
    after = watch.look()
    assert f"set {way} by {abs(set_s):.0f} s" in watch.detail
    assert after.epoch != before.epoch
    host.pass_time(SHOWN_S - 1)
    assert (watch.look().epoch, bool(watch.detail)) == (after.epoch, True)
    host.pass_time(2.0)
    assert (watch.look().epoch, watch.detail, watch.sets) == (after.epoch, "", 1)


def test_a_step_of_a_fifth_of_a_second_is_a_set_too(kept: Path) -> None:
    host = Host()
    watch = ClockWatch(kept, host)
    before = watch.look()
    host.utc_s += 0.2  # ntpd steps the clock from 0.128 s on: ntpd(8), -x
    assert watch.look().epoch != before.epoch
    assert watch.sets == 1


def test_a_clock_that_runs_a_little_fast_for_days_was_not_set(kept: Path) -> None:
    host = Host()
    watch = ClockWatch(kept, host)
    first = watch.look()
    for _ in range(14_400):
        host.pass_time(60.0)
        host.utc_s += 60.0 * 500e-6  # the most that adjtime slews: adjtimex(2)
        assert watch.look().epoch == first.epoch
    assert watch.sets == 0


def kept_epoch(kept: Path, host: Host) -> str:
    """The epoch of a gateway that starts, and keeps it."""
    watch = ClockWatch(kept, host)
    watch.keep()
    return watch.look().epoch


def test_an_epoch_goes_on_over_a_restart_and_ends_with_a_set_while_the_gateway_was_down(kept: Path) -> None:
    host = Host()
    first = kept_epoch(kept, host)
    host.pass_time(3600.0)
    assert kept_epoch(kept, host) == first
    host.pass_time(3600.0)
    host.utc_s -= 14 * DAY_S
    watch = ClockWatch(kept, host)
    assert watch.look().epoch != first
    assert "set back by 1209600 s" in watch.detail
    watch.keep()
    assert kept_epoch(kept, host) == watch.look().epoch


def test_a_reboot_begins_an_epoch_for_nobody_knows_what_the_clock_did_meanwhile(kept: Path) -> None:
    host = Host()
    first = kept_epoch(kept, host)
    host.boot(off_s=60.0)
    watch = ClockWatch(kept, host)
    assert watch.look().epoch != first
    assert (watch.sets, watch.detail) == (0, "")


@pytest.mark.parametrize(
    "damage", ["", "{", "[1]", "[" * 9000, '{"epoch": 3}', '{"epoch": "", "kernel_boot": "boot 1"}']
)
def test_an_epoch_that_can_not_be_read_back_is_followed_by_a_new_one(kept: Path, damage: str) -> None:
    host = Host()
    first = kept_epoch(kept, host)
    kept.write_text(damage)
    again = kept_epoch(kept, host)
    assert again not in ("", first)
    assert kept_epoch(kept, host) == again


def test_a_disk_that_keeps_no_epoch_stops_nobody_and_keeps_it_when_it_can(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    host, kept = Host(), tmp_path / "no folder yet" / "clock-epoch.json"
    watch = ClockWatch(kept, host)
    epochs = set[str]()
    for _ in range(3):
        watch.keep()
        epochs.add(watch.look().epoch)
    assert len(epochs) == 1 and "" not in epochs
    assert caplog.text.count("can't be written") == 1
    kept.parent.mkdir()
    watch.keep()
    assert {kept_epoch(kept, host)} == epochs


def test_two_gateways_never_draw_the_same_epoch(tmp_path: Path) -> None:
    host = Host()
    epochs = {ClockWatch(tmp_path / f"{number}.json", host).look().epoch for number in range(100)}
    assert len(epochs) == 100


def test_the_offset_is_that_of_the_hosts_own_clocks(kept: Path) -> None:
    offset_s = ClockWatch(kept).look().utc_offset_s
    before_s, utc_s, after_s = time.monotonic(), time.time(), time.monotonic()
    assert before_s - 0.001 <= utc_s - offset_s <= after_s + 0.001


def test_threads_that_look_at_the_moment_of_a_set_agree_on_the_epoch(kept: Path) -> None:
    host = Host()
    watch = ClockWatch(kept, host)
    watch.look()
    host.utc_s += DAY_S
    seen: set[str] = set()
    threads = [Thread(target=lambda: seen.add(watch.look().epoch)) for _ in range(16)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert (len(seen), watch.sets) == (1, 1)


def test_clocks_that_were_not_read_at_one_moment_are_read_again(kept: Path) -> None:
    """A slot of turns/timetable.py has no share for an error of the offset."""
    host, reads = Host(), []

    def now() -> Instant:
        reads.append(host())
        if len(reads) == 1:
            time.sleep(0.0005)  # another process breaks in
        return reads[-1]

    ClockWatch(kept, now).look()
    assert len(reads) > 1
