"""The commands of the pages that need no hardware, typed one after the other as somebody would who reads them."""

import shutil
from contextlib import ExitStack
from pathlib import Path

from docs.test_commands import in_blocks
from docs.walk import Walk, all_printed, block_of, radar_file, site_file
from mapper.live_site import paper_survey
from system.processes import ROOT, free_ports, wait_until

from mapper import wall_survey
from noctule import survey

TEN_SWEEPS = 10


def documented() -> set[str]:
    return {command.text for command in in_blocks()}


def test_a_site_is_simulated_served_mapped_and_looked_after(tmp_path: Path) -> None:
    unit_port, zenoh_port = free_ports(2)
    endpoint = f"tcp/127.0.0.1:{zenoh_port}"
    walk = Walk(tmp_path, documented(), endpoint)
    (tmp_path / "attic-room.toml").write_text(block_of("firmware/simulator/README.md", 'name = "attic"'))
    (tmp_path / "attic.toml").write_text(site_file(unit_port))
    (tmp_path / "firmware").symlink_to(ROOT / "firmware")

    walk.types("noctule-sim --room attic-room.toml --svg attic.svg")
    assert "<svg" in (tmp_path / "attic.svg").read_text()
    walk.types("noctule-sim --room attic-room.toml --site attic-room-site.toml")
    assert "closed = false" in (tmp_path / "attic-room-site.toml").read_text()

    with ExitStack() as ends:
        for line, more in (
            ("noctule-sim --room attic-room.toml", f"--speed 20 --exact-clocks --tcp 127.0.0.1:{unit_port}"),
            ("noctule-gateway run attic.toml --data gateway-data", f"--listen {endpoint}"),
            ("noctule-mapper run --site attic --data mapper-data", f"--connect {endpoint} --rerun none"),
        ):
            process = walk.starts(line, f"{more} > {line.split()[0]}.log 2>&1")
            ends.callback(all_printed, process)
            ends.callback(process.terminate)
        wait_until(lambda: " u7 " in walk.types("noctule units attic.toml", status=(0, 1)), "the unit")

        walk.types_until("noctule watch attic", tmp_path / "watched", 3)
        walk.types_until("noctule record attic attic.jsonl", tmp_path / "attic.jsonl", TEN_SWEEPS)
        doctor = walk.types("noctule doctor attic.toml --data gateway-data", status=(0, 1, 3))
        assert "ok       site file" in doctor and "ok       router" in doctor

        walk.types("noctule rpc attic u7 stop")  # it ends its reading first, and is busy until then
        calibrate = "noctule rpc attic u7 calibrate --half-steps-per-turn 4080.5 --backlash-half-steps 7"
        wait_until(lambda: "busy" not in walk.types(calibrate, status=(0, 1)), "the unit's rest")
        walk.types("noctule rpc attic u7 trim_temperature --temperature-c 21.3")
        walk.types("noctule rpc attic u7 store")
        assert "4080.5" in walk.types("noctule rpc attic u7 settings")
        walk.types("noctule update firmware/build/update.hex --site attic")

        assert "all is sound" in walk.types("noctule-gateway check gateway-data")
        walk.types("noctule-gateway backup gateway-data gateway-copy")

    walk.types("noctule-mapper fit attic.jsonl --contour contour.json --svg attic.svg")
    walk.types("noctule-mapper export contour.json attic.geojson")


def test_another_scanners_file_and_a_wall_are_made_use_of(tmp_path: Path) -> None:
    walk = Walk(tmp_path, documented(), "tcp/127.0.0.1:1")
    with (tmp_path / "paper.jsonl").open("w") as stream:
        survey.write(paper_survey(), stream)
    radar_file(tmp_path / "radar.csv", tmp_path / "paper.jsonl")
    found = walk.types(
        "noctule import radar.csv --angle angle --range distance_cm --x x_m --y y_m --heading heading_deg"
        " --forward-deg 90 --no-echo 0"
    )
    assert "44 places" in found
    assert "There is no screen here" in walk.types("noctule-mapper fit radar.jsonl --svg room.svg --view")

    with (tmp_path / "wall.jsonl").open("w") as stream:
        survey.write(wall_survey.sweeps(wall_survey.ranges_m(1)), stream)
    (tmp_path / "attic.toml").write_text(site_file(7001))
    walk.types("noctule-mapper calibrate wall.jsonl --wall-distance 0.3 --site attic.toml")
    assert "[sensor]" in (tmp_path / "attic.toml").read_text()


def test_a_fleet_is_rendered_renewed_and_signed_for(tmp_path: Path) -> None:
    walk = Walk(tmp_path, documented(), "tcp/127.0.0.1:1")
    walk.types("noctule-deploy init fleet && cd fleet")
    walk.folder = tmp_path / "fleet"
    walk.types("noctule-deploy render")
    assert walk.types("noctule-deploy check") == "all is well\n"
    walk.types("noctule-deploy renew gateway.attic")
    walk.types("noctule-deploy revoke gateway.attic")
    shutil.copy(ROOT / "firmware/build/update.hex", walk.folder)
    assert "[firmware.keys]" in walk.types("noctule-deploy firmware-key release.pem")
    walk.types("noctule-deploy firmware-sign update.hex --key release.pem")
