"""A fleet on one machine, through one power cut after another."""

from pathlib import Path

import pytest
from system.processes import Programs, free_port_range, programs, wait_until

from noctule.client import Client
from noctule.messages_pb2 import Sweep

SITE = "fleet"
UNITS = 20
CUTS = 3
SWEEPS_BETWEEN_CUTS = 3  # one takes some 7 s of a unit's time
SPEED = 2  # that the simulator keeps up with while the gateway and the mapper run beside it


@pytest.mark.soak
@pytest.mark.timeout(1800)
def test_a_fleet_whose_gateway_and_mapper_are_killed_again_and_again_loses_no_sweep(tmp_path: Path) -> None:
    unit_port = free_port_range(UNITS + 1)
    endpoint = f"tcp/127.0.0.1:{unit_port + UNITS}"
    write_site(tmp_path / "site.toml", unit_port)
    simulator = f"noctule-sim --room paper --units {UNITS} --speed {SPEED} --tcp 127.0.0.1:{unit_port} --seed 3"
    gateway = f"noctule-gateway run {tmp_path}/site.toml --data {tmp_path}/gateway --listen {endpoint}"
    mapper = f"noctule-mapper run --site {SITE} --data {tmp_path}/mapper --connect {endpoint} --rerun none"
    with programs(tmp_path) as running:
        running.start("simulator", *simulator.split())
        running.start("gateway", *gateway.split())
        running.start("mapper", *mapper.split())
        for cut in range(1, CUTS + 1):
            wait_for_sweeps(endpoint, running, cut * SWEEPS_BETWEEN_CUTS)
            name, command = ("mapper", mapper) if cut % 3 == 0 else ("gateway", gateway)
            running.kill(name)
            running.start(name, *command.split())
        wait_for_sweeps(endpoint, running, (CUTS + 1) * SWEEPS_BETWEEN_CUTS)
        logs = {name: logged_sweeps(endpoint, name) for name in unit_names()}
        wait_for_cursors(endpoint, running, {name: sweeps[-1].log_sequence for name, sweeps in logs.items()})
        for name in ("mapper", "gateway", "simulator"):
            assert running.end(name) == 0, running.log(name)

    for name, sweeps in logs.items():
        assert [sweep.log_sequence for sweep in sweeps] == list(range(1, len(sweeps) + 1)), name
        assert [sweep.sequence for sweep in sweeps] == list(range(len(sweeps))), name


def unit_names() -> list[str]:
    return [f"u{number}" for number in range(1, UNITS + 1)]


def write_site(path: Path, first_port: int) -> None:
    """A site of units that stand where the simulator's path begins and sweep coarsely without end."""
    text = f'site = "{SITE}"\nclock = "unit"\nair_temperature_c = 21.0\n'
    for number, name in enumerate(unit_names()):
        text += f"""
[[unit]]
name = "{name}"
serial = {number + 1}
address = "socket://127.0.0.1:{first_port + number}"
pose = {{ x_m = -0.70, y_m = -0.45, heading_deg = 0 }}
sweep = {{ start = true, count = 13 }}
"""
    path.write_text(text)


def wait_for_sweeps(endpoint: str, running: Programs, count: int) -> None:
    """Wait until every unit's log holds that many sweeps."""

    def logged() -> bool:
        running.check()
        heads = {status.unit: status.log_head for status in client.unit_statuses()}
        return len(heads) == UNITS and min(heads.values()) >= count

    with Client(SITE, connect=[endpoint]) as client:
        wait_until(logged, f"fewer than {count} sweeps in a log", within_s=240, every_s=0.5)


def logged_sweeps(endpoint: str, unit: str) -> list[Sweep]:
    """What the unit's log holds now, whole."""
    with Client(SITE, connect=[endpoint]) as client:
        records = client.log(unit, from_sequence=1)
    assert records is not None
    assert len(records.sweeps) == records.head
    return list(records.sweeps)


def wait_for_cursors(endpoint: str, running: Programs, heads: dict[str, int]) -> None:
    """Wait until the mapper shows that it holds every one of these sweeps."""
    seen: dict[str, int] = {}

    def passed() -> bool:
        running.check()
        return all(seen.get(unit, 0) >= head for unit, head in heads.items())

    with Client(SITE, connect=[endpoint]) as client:
        client.on_service_status(
            lambda status: seen.update({cursor.unit: cursor.log_sequence for cursor in status.cursors})
        )
        wait_until(passed, "the mapper's cursors stay behind")
