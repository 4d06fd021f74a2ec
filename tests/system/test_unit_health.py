"""A sensor goes deaf while a site is mapped: every view of the site names it, and the map rests on what was before."""

import json
import subprocess
from pathlib import Path

from rooms import site_file
from system.processes import PATIENCE_S, free_ports, listens, programs, wait_until

from noctule.client import Client
from noctule.messages_pb2 import FAULT_KIND_SILENT, ServiceStatus, UnitStatus

SPEED = 20
LEARNT_AFTER = 14  # sweeps: as in test_unit_faults
LEFT_OUT = ("sweeps_unusable", "sweeps_taken_out")  # made while the fault had a name, and just before
FAULT = '[[fault]]\nat_s = 0.0\nkind = "sensor_deaf"\n'


def test_a_deaf_sensor_is_told_in_units_report_status_and_map_and_outlives_a_restart(tmp_path: Path) -> None:
    unit_port, bus_port = free_ports(2)
    site, faults, data = tmp_path / "site.toml", tmp_path / "faults.toml", tmp_path / "gateway"
    site.write_text(only_first_unit(site_file("lounge", unit_port)))
    faults.write_text(FAULT)
    endpoint = f"tcp/127.0.0.1:{bus_port}"
    line = ("--tcp", f"127.0.0.1:{unit_port}", "--speed", str(SPEED), "--state", str(tmp_path / "flash"))
    simulator = ("noctule-sim", "--room", "lounge", "--units", "1", *line)
    gateway = ("noctule-gateway", "run", str(site), "--data", str(data), "--listen", endpoint)
    mapper = ("noctule-mapper", "run", "--site", "lounge", "--data", str(tmp_path / "map"), "--rerun", "none")
    with programs(tmp_path) as running:
        running.start("gateway", *gateway)
        running.start("mapper", *mapper, "--connect", endpoint)
        wait_until(lambda: running.check() or listens(bus_port), "no router")
        running.start("simulator", *simulator)
        with Client("lounge", connect=[endpoint]) as client:

            def learnt() -> bool:
                running.check()
                return "u1" in client.units() and len(list(client.history("u1"))) >= LEARNT_AFTER

            wait_until(learnt, "too few sweeps are logged", every_s=1.0)
            assert not any(sweep.faults for sweep in client.history("u1"))
            running.end("simulator")
            running.start("simulator", *simulator, "--faults", str(faults))

            def faulty() -> UnitStatus | None:
                running.check()
                return next((one for one in client.unit_statuses() if one.faults), None)

            status = wait_until(faulty, "no fault is named")
            assert [fault.kind for fault in status.faults] == [FAULT_KIND_SILENT]
            assert status.detail.startswith("silent: ")

            # The status may tell it while the sweep that showed it is still on its way to the disk.
            named = wait_until(lambda: next((one for one in client.history("u1") if one.faults), None), "none has it")
            sweeps = list(client.history("u1"))
            first = named.log_sequence - named.suspect_before
            assert len([one for one in sweeps if heard_nothing(one) and one.log_sequence <= named.log_sequence]) <= 3
            assert all(first <= one.log_sequence for one in sweeps if heard_nothing(one))

            def left_out() -> ServiceStatus | None:
                services = [one for one in client.service_statuses() if one.role == "mapper"]
                return next((one for one in services if all(map(one.counters.get, LEFT_OUT))), None)

            told = wait_until(left_out, "the mapper leaves no sweep out")
            assert "its gateway had found the unit silent" in told.detail

            assert "silent: no echo at 61 bearings" in noctule("units", "lounge", endpoint)
            report = noctule("unit-report", "lounge", endpoint, "u1", "--output", str(tmp_path / "u1.txt"))
            assert (tmp_path / "u1.txt").read_text() == report
            for text in ("silent: no echo at 61 bearings", "half steps per turn", "  bearing  readings  echoes"):
                assert text in report
            found = json.loads(noctule("unit-report", "lounge", endpoint, "u1", "--json"))
            assert found["status"]["faults"][0]["kind"] == "FAULT_KIND_SILENT"
            assert len(found["bearings"]) == 61

        running.kill("gateway")
        running.start("gateway", *gateway)
        wait_until(lambda: running.check() or listens(bus_port), "no router")
        with Client("lounge", connect=[endpoint]) as client:
            since = wait_until(faulty_of(client), "the fault is forgotten").faults[0].since
        assert since == status.faults[0].since


def faulty_of(client: Client):
    return lambda: next((one for one in client.unit_statuses() if one.faults), None)


def heard_nothing(sweep) -> bool:
    return not any(reading.HasField("time_of_flight_s") for reading in sweep.readings)


def noctule(command: str, site: str, endpoint: str, *more: str) -> str:
    run = subprocess.run(
        ["noctule", command, site, *more, "--connect", endpoint],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=True,
    )
    return run.stdout


def only_first_unit(text: str) -> str:
    """The site file without its other units."""
    head, first, *_ = text.split("[[unit]]")
    return f"{head}[[unit]]{first}"
