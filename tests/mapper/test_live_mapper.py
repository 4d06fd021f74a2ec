"""The live mapper as a process on a real bus: what it publishes, and what it does when it is killed or fed rubbish."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from socket import gethostname

import numpy as np
import psutil
import pytest
from mapper.live_site import SITE, LiveSite, live_site, message, paper_survey
from mapper.rerun_relay import relay
from system.processes import wait_until
from system.test_operations import end_in_time

from mapper import room
from noctule import bus, keys
from noctule.messages_pb2 import Contour, Features, GridTile, ServiceStatus, Sweep
from noctule_mapper.config import Window
from noctule_mapper.live.store import SweepStore
from noctule_mapper.mapper import Mapper
from noctule_mapper.readings.sweep import from_message
from noctule_mapper.survey_fit import fit

SAME_M = 1e-6  # the order in which sums are made; a sweep more or less moves walls by far more


@pytest.fixture
def site(tmp_path: Path) -> Iterator[LiveSite]:
    with live_site(tmp_path) as made:
        yield made


def assert_same_map(contour: Contour, expected: Contour) -> None:
    assert (contour.site, contour.method) == (SITE, expected.method)
    assert len(contour.walls) == len(expected.walls) > 0
    assert len(contour.cylinders) == len(expected.cylinders)
    for wall, wanted in zip(contour.walls, expected.walls, strict=True):
        assert (wall.theta_rad, wall.rho_m) == pytest.approx((wanted.theta_rad, wanted.rho_m), abs=SAME_M)
    for cylinder, wanted in zip(contour.cylinders, expected.cylinders, strict=True):
        assert (cylinder.x_m, cylinder.y_m, cylinder.radius_m) == pytest.approx(
            (wanted.x_m, wanted.y_m, wanted.radius_m), abs=SAME_M
        )


def test_a_survey_becomes_the_contour_that_fitting_its_file_gives(site: LiveSite) -> None:
    survey = paper_survey()
    site.start_mapper()
    site.play(survey)
    contour = site.contour_of(len(survey))
    assert_same_map(contour, fit(survey))
    assert contour.mapper == "mapper"
    assert contour.time == survey[-1].start
    assert site.running.end("mapper") == 0


def test_who_joins_late_gets_features_grid_and_status_too(site: LiveSite) -> None:
    survey = paper_survey()[:12]
    site.start_mapper()
    site.play(survey)
    site.contour_of(len(survey))
    features, tiles, statuses = [], [], []
    site.client.on_features(features.append)
    site.client.on_grid(tiles.append)
    site.client.on_service_status(statuses.append)
    wait_until(lambda: features and tiles and statuses, "no late joiner's features, tiles and status")
    newest: Features = features[0]
    tile: GridTile = tiles[0]
    status: ServiceStatus = statuses[0]
    assert newest.time == survey[-1].start
    assert len(tile.occupied) == len(tile.free) == tile.rows * tile.columns > 0
    assert (status.role, status.counters["sweeps_unusable"]) == ("mapper", 0)


def test_a_mapper_killed_in_mid_survey_ends_with_the_same_map_and_every_sweep(site: LiveSite, tmp_path: Path) -> None:
    survey = paper_survey()
    site.start_mapper()
    site.play(survey[:15])
    before = site.contour_of(15)
    site.play(survey[15:20])
    site.running.kill("mapper")
    site.play(survey[20:30])
    site.start_mapper()
    site.play(survey[30:])
    contour = site.contour_of(len(survey))
    assert_same_map(contour, fit(survey))
    assert contour.version > before.version
    site.running.end("mapper")
    store = SweepStore(tmp_path / f"{SITE}.sqlite3", Window())
    assert [sweep.log_sequence for sweep in store.sweeps()] == list(range(1, len(survey) + 1))
    assert store.cursors()["u1"].log_sequence == len(survey)
    store.close()


def test_a_sweep_without_a_pose_is_counted_and_passed_over_and_the_status_says_what_is_lacking(site: LiveSite) -> None:
    survey = paper_survey()[:6]
    for sweep in survey[2:4]:
        sweep.ClearField("pose")
    site.start_mapper()
    statuses: list[ServiceStatus] = []
    site.client.on_service_status(statuses.append)
    site.play(survey[:1])
    lacking = "echoes from 1 place; a wall needs 3 (2 if over 0.65 m apart), a cylinder 3"
    wait_until(lambda: statuses and statuses[-1].detail == lacking, "the status does not say why")
    site.play(survey[1:])
    site.contour_of(4)
    wait_until(lambda: statuses and statuses[-1].counters["sweeps_taken"] == 6, "the status does not come")
    assert statuses[-1].counters["sweeps_unusable"] == 2
    assert "2 sweeps of u1 left out, the last: sweep" in statuses[-1].detail
    assert "has no pose" in statuses[-1].detail
    assert [cursor.log_sequence for cursor in statuses[-1].cursors] == [6]
    assert site.running.log("mapper").count("has no pose") == 1


def test_the_last_sweep_left_out_is_the_newest_though_it_is_looked_at_first_and_a_new_map_does_not_clear_it(
    site: LiveSite, tmp_path: Path
) -> None:
    config = tmp_path / "mapper.toml"
    config.write_text("[window]\nsweeps_per_place = 12\n")
    (first, *_), stay = paper_survey(), list[Sweep]()
    for number in range(1, 17):
        stay.append(Sweep())
        stay[-1].CopyFrom(first)
        stay[-1].sequence = number
        stay[-1].start.FromNanoseconds(first.start.ToNanoseconds() + number * 10**9)
    for sweep in (stay[13], stay[15]):
        for reading in sweep.readings:
            reading.time_of_flight_s = 0.005  # a stuck sensor
    site.play(stay)
    statuses: list[ServiceStatus] = []
    site.client.on_service_status(statuses.append)
    site.start_mapper("--config", str(config))
    wait_until(lambda: statuses and statuses[-1].counters["sweeps_unusable"] == 2, "no sweep is left out")
    told = "2 sweeps of u1 left out, the last: sweep 16 of"
    assert told in statuses[-1].detail
    site.contour_of(12)
    _, map_process = psutil.Process(site.running.pid("mapper")).children(recursive=True)
    map_process.kill()
    wait_until(
        lambda: statuses[-1].counters["map_restarts"] == 1 and "process" not in statuses[-1].detail, "no new map"
    )
    assert told in statuses[-1].detail


def test_sweeps_that_leave_the_window_leave_the_map(site: LiveSite, tmp_path: Path) -> None:
    config = tmp_path / "mapper.toml"
    config.write_text("[window]\nmax_sweeps = 10\n")
    survey = paper_survey()
    site.start_mapper("--config", str(config))
    site.play(survey[:20])
    site.play(survey[20:30])
    wait_until(lambda: site.contour_of(10).time == survey[29].start, "no contour of the last sweeps")
    assert_same_map(site.contour_of(10), fit(survey[20:30]))


def test_who_joins_late_is_told_of_no_tile_that_has_lost_all_its_evidence(site: LiveSite, tmp_path: Path) -> None:
    config = tmp_path / "mapper.toml"
    config.write_text("[window]\nmax_sweeps = 8\n")
    survey = paper_survey()[:16]
    for sweep in survey[8:]:
        sweep.pose.x_m += 20.0
    site.start_mapper("--config", str(config))
    site.play(survey[:8])
    site.contour_of(8)
    site.play(survey[8:])
    wait_until(lambda: site.contour_of(8).time == survey[-1].start, "no contour of the last sweeps")
    alone = Mapper()
    for sweep in survey[8:]:
        alone.register_sweep(from_message(sweep))
    expected = {(tile.tile_x, tile.tile_y) for tile in alone.grid.tiles()}
    told: set[tuple[int, int]] = set()
    site.client.on_grid(lambda tile: told.add((tile.tile_x, tile.tile_y)))
    wait_until(lambda: told >= expected, "not all tiles for a late joiner")
    assert told == expected


def test_a_cylinder_carried_elsewhere_while_the_mapper_is_down_moves_on_its_map(site: LiveSite) -> None:
    rng = np.random.default_rng(311)
    before = room.paper_room()
    after = replace(before, cylinders=((0.30, 0.35, 0.448),))
    first, second = ([message(one) for one in room.survey(each, room.paper_path(), rng)] for each in (before, after))
    for sweep in second:
        sweep.start.seconds += 1000
    site.start_mapper()
    site.play(first)
    old = site.contour_of(len(first))
    site.running.kill("mapper")
    site.play(second[:30])
    site.start_mapper()
    site.play(second[30:])
    wait_until(lambda: site.contour_of(44).time == second[-1].start, "no contour of the second round")
    new = site.contour_of(44)
    assert new.version > old.version
    ((x_m, _, _), (new_x_m, _, _)) = *before.cylinders, *after.cylinders
    assert [one.x_m for one in old.cylinders] == pytest.approx([x_m], abs=0.01)
    assert [one.x_m for one in new.cylinders] == pytest.approx([new_x_m], abs=0.01)


def test_mapping_goes_on_when_the_relay_dies_and_ends_without_waiting_for_it(site: LiveSite) -> None:
    survey = paper_survey()[:12]
    with relay() as far_end:
        far_end.start()
        site.start_mapper(rerun=far_end.url)
        site.play(survey[:6])
        site.contour_of(6)
        wait_until(lambda: "drawing on the Rerun relay" in site.running.log("mapper"), "no relay is drawn on")
    site.play(survey[6:])
    site.contour_of(12)
    wait_until(lambda: "went away" in site.running.log("mapper"), "the relay is not missed")
    assert end_in_time(site.running, "mapper") == 0


def test_a_mapper_ends_though_its_relay_does_not_take_what_it_draws(site: LiveSite) -> None:
    survey = paper_survey()
    with relay() as far_end:
        far_end.start()
        site.start_mapper(rerun=far_end.url)
        site.play(survey[:6])
        site.contour_of(6)
        wait_until(lambda: "drawing on the Rerun relay" in site.running.log("mapper"), "no relay is drawn on")
        far_end.freeze()
        for first in range(6, 44, 4):
            site.play(survey[first : first + 4])
            site.contour_of(min(first + 4, 44))
        assert end_in_time(site.running, "mapper") == 0


def test_a_second_mapper_of_the_site_stands_in_the_first_ones_status_until_it_is_gone(site: LiveSite) -> None:
    site.start_mapper()

    def detail() -> str | None:
        statuses = {status.name: status for status in site.client.service_statuses()}
        return statuses["mapper"].detail if "mapper" in statuses else None

    wait_until(lambda: detail() is not None, "there is no mapper")
    with bus.open_session([site.endpoint]) as session:
        second = bus.StatePublisher(session, keys.service_status(SITE, "second"), ServiceStatus)
        told = f"another mapper maps this site too (second on {gethostname()}): stop one of them"

        def is_told() -> bool:
            second.put(ServiceStatus(site=SITE, name="second", role="mapper"))
            return told in (detail() or "")

        wait_until(is_told, "the first does not say it")
        second.close()
    wait_until(lambda: told not in (detail() or told), "it is still told")


def test_a_mapper_that_waits_for_its_router_ends_when_it_is_told_to(site: LiveSite, tmp_path: Path) -> None:
    nobody = "tcp/127.0.0.1:9"  # the discard port, where nothing listens
    where = ("--site", SITE, "--data", str(tmp_path), "--connect", nobody)
    site.running.start("mapper", "noctule-mapper", "run", *where)
    wait_until(lambda: "no router answers" in site.running.log("mapper"), "it does not say that it waits")
    assert end_in_time(site.running, "mapper") == 0


def test_a_mapper_that_is_set_up_wrongly_says_so_and_ends_with_an_error(site: LiveSite, tmp_path: Path) -> None:
    (tmp_path / f"{SITE}.sqlite3").mkdir()
    site.start_mapper()
    wait_until(lambda: "can't be used as the mapper's store" in site.running.log("mapper"), "nothing is said")
    assert "Traceback" not in site.running.log("mapper")
    assert site.running.wait("mapper") == 1


_THREAD_DIES = """
import sys, threading, time
from noctule_mapper.cli import main

class PanicException(BaseException):  # as pyo3's, which Zenoh raises
    pass

def panic():
    while threading.excepthook is threading.__excepthook__:
        time.sleep(0.01)
    raise PanicException("a key of 65536 characters")

threading.Thread(target=panic, name="noctule-follow", daemon=True).start()
main(sys.argv[1:])
"""


def test_a_thread_that_dies_takes_the_mapper_with_it(site: LiveSite, tmp_path: Path) -> None:
    where = ("--site", SITE, "--data", str(tmp_path), "--connect", site.endpoint, "--rerun", "none")
    site.running.start("mapper", "python", "-c", _THREAD_DIES, "run", *where)
    wait_until(lambda: "a key of 65536" in site.running.log("mapper"), "nothing is said")
    assert "CRITICAL" in site.running.log("mapper")
    assert "noctule-follow" in site.running.log("mapper")
    assert site.running.wait("mapper") == 70


def test_a_sweep_that_broke_the_map_is_told_in_the_status_until_after_a_restart(site: LiveSite, tmp_path: Path) -> None:
    survey = paper_survey()[:4]
    site.start_mapper()
    site.play(survey)
    site.contour_of(4)
    held = site.running.end("mapper")
    store = SweepStore(tmp_path / f"{SITE}.sqlite3", Window())
    bad = store.sweeps()[2]
    store.set_aside((bad.log_id, bad.log_sequence), "IndexError: no such bin")
    store.close()
    statuses: list[ServiceStatus] = []
    site.client.on_service_status(statuses.append)
    site.start_mapper()
    site.contour_of(3)
    wait_until(lambda: statuses and statuses[-1].detail, "no detail")
    assert (held, statuses[-1].counters["sweeps_set_aside"]) == (0, 1)
    assert f"sweep {bad.log_sequence} of {bad.log_id!r} (unit 'u1', IndexError: no such bin)" in statuses[-1].detail


def test_a_store_that_takes_no_more_is_told_once_and_in_the_status_and_costs_no_sweep(
    site: LiveSite, tmp_path: Path
) -> None:
    survey = paper_survey()[:8]
    statuses: list[ServiceStatus] = []
    site.client.on_service_status(statuses.append)
    site.start_mapper()
    site.play(survey[:4])
    site.contour_of(4)
    # As on a full disk: no file of this process grows past what its store's journal has now.
    process = psutil.Process(site.running.pid("mapper"))
    journal = (tmp_path / f"{SITE}.sqlite3-wal").stat().st_size
    process.rlimit(psutil.RLIMIT_FSIZE, (journal, psutil.RLIM_INFINITY))
    site.play(survey[4:])
    full = f"the mapper's store {tmp_path / SITE}.sqlite3 can't be used"
    wait_until(lambda: statuses and full in statuses[-1].detail, "the status does not say it")
    wait_until(lambda: statuses[-1].counters["log_failed"] >= 4, "it is not tried again")
    process.rlimit(psutil.RLIMIT_FSIZE, (psutil.RLIM_INFINITY, psutil.RLIM_INFINITY))
    site.contour_of(8)
    wait_until(lambda: full not in statuses[-1].detail, "the status still says it")
    log = site.running.log("mapper")
    assert (log.count("the sweeps wait in the gateways' logs"), log.count("Traceback")) == (1, 0)
    assert site.running.end("mapper") == 0


def test_the_status_says_whose_log_can_not_be_read_and_why(site: LiveSite) -> None:
    statuses: list[ServiceStatus] = []
    site.client.on_service_status(statuses.append)
    session = site.client.session
    sick = session.declare_queryable(keys.log(SITE, "u9"), lambda query: query.reply_err(b"its disk is gone"))
    served = session.liveliness().declare_token(keys.alive(SITE, "u9"))
    site.start_mapper()
    told = "the log of u9 can't be read: "
    wait_until(lambda: statuses and told in statuses[-1].detail, "the status does not say it")
    assert "its disk is gone" in statuses[-1].detail
    sick.undeclare()
    served.undeclare()
    wait_until(lambda: told not in statuses[-1].detail, "the status still says it")


def test_the_first_echo_of_an_uncalibrated_sensor_makes_a_map_with_nothing_on_it(site: LiveSite) -> None:
    first = paper_survey()[0]
    first.ClearField("sensor")
    del first.readings[1:]
    site.start_mapper()
    site.play([first])
    contour = site.contour_of(1)
    assert not (contour.walls or contour.corners or contour.cylinders)
    assert "Traceback" not in site.running.log("mapper")
