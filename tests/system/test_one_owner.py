"""A data folder has one owner, and so has a router's port: second gateways and mappers are refused in words, and killed
ones leave it free.
"""

import socket
from pathlib import Path

import pytest
from system.processes import Programs, free_ports, programs, wait_until

NOTHING_LISTENS = 9  # the discard port

SITE = """
site = "{name}"

[[unit]]
name = "u1"
serial = 1
address = "socket://127.0.0.1:{line}"
pose = {{ x_m = 0.0, y_m = 0.0, heading_deg = 0.0 }}
"""


def gateway(
    folder: Path, data: Path, site: str = "attic", port: int | None = None, line: int = NOTHING_LISTENS
) -> tuple[str, ...]:
    """A gateway with a router of its own, at ``port``, for a site with a unit u1 that is away."""
    file = folder / f"{site}.toml"
    file.write_text(SITE.format(name=site, line=line))
    port = port or free_ports(1)[0]
    return "noctule-gateway", "run", str(file), "--data", str(data), "--listen", f"tcp/127.0.0.1:{port}"


def mapper(data: Path, site: str = "attic") -> tuple[str, ...]:
    """A mapper that waits for its router."""
    where = ("--data", str(data), "--connect", "tcp/127.0.0.1:9")
    return "noctule-mapper", "run", "--site", site, *where, "--rerun", "none"


def run_until(running: Programs, name: str, command: tuple[str, ...], said: str) -> None:
    running.start(name, *command)
    try:
        wait_until(lambda: said in running.log(name), f"{name} did not say {said!r}")
    except AssertionError as error:
        raise AssertionError(f"{error}: {running.log(name)}") from None


@pytest.mark.parametrize("role", ["gateway", "mapper"])
def test_a_second_one_is_refused_with_the_first_ones_name_and_process_until_that_is_killed(
    tmp_path: Path, role: str
) -> None:
    data = tmp_path / "data"
    command = gateway(tmp_path, data) if role == "gateway" else mapper(data)
    up = "on the bus" if role == "gateway" else "waiting for it"
    with programs(tmp_path) as running:
        run_until(running, "first", command, up)
        holder = f"{data} is in use by {role} '{role}' of site 'attic' (process {running.pid('first')}): stop that"
        run_until(running, "second", command, holder)
        assert running.wait("second") == 1
        assert "Traceback" not in running.log("second")
        running.kill("first")
        run_until(running, "third", command, up)
        assert running.end("third") == 0


def test_a_folder_of_another_site_or_another_kind_of_service_is_refused_though_nothing_runs_on_it(
    tmp_path: Path,
) -> None:
    data = tmp_path / "data"
    with programs(tmp_path) as running:
        run_until(running, "owner", gateway(tmp_path, data), "on the bus")
        running.kill("owner")
        whose = f"{data} holds the data of a gateway of site 'attic'"
        run_until(running, "cellar", gateway(tmp_path, data, "cellar"), whose)
        run_until(running, "mapper", mapper(data), whose)
        assert (running.wait("cellar"), running.wait("mapper")) == (1, 1)


def test_a_gateway_whose_routers_port_is_taken_opens_no_line(tmp_path: Path) -> None:
    with programs(tmp_path) as running, socket.create_server(("127.0.0.1", 0)) as taken, socket.socket() as line:
        line.bind(("127.0.0.1", 0))
        line.listen()
        line.setblocking(False)
        at = taken.getsockname()[1]
        command = gateway(tmp_path, tmp_path / "data", port=at, line=line.getsockname()[1])
        run_until(running, "gateway", command, f"port {at} is in use by ")
        assert running.wait("gateway") == 1
        assert "Traceback" not in running.log("gateway")
        with pytest.raises(BlockingIOError):  # nobody has come
            line.accept()


@pytest.mark.parametrize("role", ["gateway", "mapper"])
def test_a_file_in_place_of_the_folder_is_named(tmp_path: Path, role: str) -> None:
    data = tmp_path / "data"
    data.write_text("")
    command = gateway(tmp_path, data) if role == "gateway" else mapper(data)
    with programs(tmp_path) as running:
        run_until(running, role, command, f"{data} is no folder: give the {role} a folder for its data")
        assert running.wait(role) == 1
