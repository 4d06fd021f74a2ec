"""noctule doctor finds what keeps a host from working. The host is a folder tree as the kernel and udev lay it out."""

import os
import subprocess
from datetime import UTC, datetime
from pathlib import Path

import pytest

from noctule.doctor import clock, configuration, data_folder, joining, serial_ports
from noctule.doctor.data_folder import Room
from noctule.doctor.finding import Finding, Level, exit_status
from noctule.doctor.host import Host
from noctule.folder_lock import FolderLock, Owner
from noctule.kernel_clock import KernelClock, kernel_clock
from noctule.site import FixedPose, Pose2, Sensor, Unit

NOBODY = 65534


class FakeHost:
    """A folder tree with USB adapters, processes and locks."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        for name in ("dev/serial/by-id", "dev/serial/by-path", "sys/class/tty", "proc", "udev"):
            (folder / name).mkdir(parents=True)
        self.host = Host(folder / "dev", folder / "sys", folder / "proc", folder / "udev", NOBODY, frozenset())

    def adapter(self, number: int, serial: str, mode: int = 0o666) -> None:
        """An adapter ttyUSB<number>, as the driver of a CP2102 shows it."""
        usb = self._folder / f"sys/devices/usb1/1-{number}"
        port = usb / f"1-{number}:1.0/ttyUSB{number}"
        port.mkdir(parents=True)
        for name, text in (("idVendor", "10c4"), ("idProduct", "ea60"), ("serial", serial)):
            (usb / name).write_text(text + "\n")
        tty = self._folder / f"sys/class/tty/ttyUSB{number}"
        tty.mkdir()
        (tty / "device").symlink_to(port)
        (tty / "dev").write_text(f"188:{number}\n")
        device = self._folder / f"dev/ttyUSB{number}"
        device.touch()
        device.chmod(mode)
        for kind, name in (("by-id", f"usb-CP2102_{serial}"), ("by-path", f"pci-1-{number}")):
            link = self._folder / "dev/serial" / kind / name
            link.unlink(missing_ok=True)  # udev gives the name of two to the last
            link.symlink_to(device)

    def process(self, pid: int, name: str, holds: str | None = None) -> None:
        files = self._folder / f"proc/{pid}/fd"
        files.mkdir(parents=True)
        (self._folder / f"proc/{pid}/comm").write_text(name + "\n")
        if holds is not None:
            (files / "7").symlink_to(self._folder / "dev" / holds)

    def ignored_by_modem_manager(self, number: int) -> None:
        (self._folder / f"udev/c188:{number}").write_text("I:1\nE:ID_MM_DEVICE_IGNORE=1\n")

    def lock(self, pid: int, file: Path) -> None:
        state = file.stat()
        place = f"{os.major(state.st_dev):02x}:{os.minor(state.st_dev):02x}:{state.st_ino}"
        (self._folder / "proc/locks").write_text(f"1: FLOCK  ADVISORY  WRITE {pid} {place} 0 EOF\n")

    def ports(self, address: str) -> list[Finding]:
        return list(serial_ports.check((unit(address),), self.host))


@pytest.fixture
def fake(tmp_path: Path) -> FakeHost:
    return FakeHost(tmp_path)


def unit(address: str) -> Unit:
    return Unit("u1", 1, address, FixedPose(Pose2(0, 0, 0)), Sensor(), None, False, 0.0)


def the_one(findings: list[Finding], level: Level) -> str:
    """The text of the only finding, which is of that level."""
    (finding,) = findings
    assert finding.level == level, finding
    return finding.text


def test_an_adapter_that_is_there_free_and_named_by_its_id_is_ok(fake: FakeHost) -> None:
    fake.adapter(0, "0001")
    fake.process(9, "noctule-gateway", holds="ttyUSB0")
    assert the_one(fake.ports("/dev/serial/by-id/usb-CP2102_0001"), Level.OK) == "is there and can be used"


def test_an_adapter_that_is_not_there_is_a_fault_that_lists_those_that_are(fake: FakeHost) -> None:
    fake.adapter(0, "0001")
    text = the_one(fake.ports("/dev/serial/by-id/usb-CP2102_0002"), Level.FAULT)
    assert text.startswith("is not there") and text.endswith("dev/serial/by-id/usb-CP2102_0001")


def test_a_number_for_a_name_is_a_warning_with_the_better_name(fake: FakeHost) -> None:
    fake.adapter(0, "0001")
    text = the_one(fake.ports("/dev/ttyUSB0"), Level.WARNING)
    assert "may be another adapter's after a restart" in text and text.endswith("by-id/usb-CP2102_0001")


def test_two_adapters_of_one_name_are_a_warning_unless_the_socket_names_them(fake: FakeHost) -> None:
    for number in (0, 1):
        fake.adapter(number, "0001")
    text = the_one(fake.ports("/dev/serial/by-id/usb-CP2102_0001"), Level.WARNING)
    assert "2 adapters have one name (10c4 ea60 0001)" in text and "by-path/pci-1-1" in text
    the_one(fake.ports("/dev/serial/by-path/pci-1-0"), Level.OK)


def test_a_port_that_the_user_may_not_use_is_a_fault_that_names_the_group(fake: FakeHost) -> None:
    fake.adapter(0, "0001", mode=0o660)
    text = the_one(fake.ports("/dev/serial/by-id/usb-CP2102_0001"), Level.FAULT)
    assert "sudo usermod -aG" in text
    gid = (fake.host.dev / "ttyUSB0").stat().st_gid
    member = Host(fake.host.dev, fake.host.sys, fake.host.proc, fake.host.udev, NOBODY, frozenset({gid}))
    found = list(serial_ports.check((unit("/dev/serial/by-id/usb-CP2102_0001"),), member))
    the_one(found, Level.OK)


def test_a_port_in_use_by_another_program_is_a_fault_that_names_it(fake: FakeHost) -> None:
    fake.adapter(0, "0001")
    fake.process(41, "minicom", holds="ttyUSB0")
    text = the_one(fake.ports("/dev/serial/by-id/usb-CP2102_0001"), Level.FAULT)
    assert text == "is in use by minicom (process 41): stop that program"


@pytest.mark.parametrize("name", ["ModemManager", "brltty"])
def test_a_program_that_opens_adapters_for_itself_is_a_warning(fake: FakeHost, name: str) -> None:
    fake.adapter(0, "0001")
    fake.process(12, name)
    text = the_one(fake.ports("/dev/serial/by-id/usb-CP2102_0001"), Level.WARNING)
    assert text.startswith(f"{name} runs and may open it")


def test_modem_manager_is_no_trouble_where_udev_keeps_it_away(fake: FakeHost) -> None:
    fake.adapter(0, "0001")
    fake.ignored_by_modem_manager(0)
    fake.process(12, "ModemManager")
    the_one(fake.ports("/dev/serial/by-id/usb-CP2102_0001"), Level.OK)


def test_units_behind_the_network_have_no_port_here(fake: FakeHost) -> None:
    assert "no unit is on a serial adapter" in the_one(fake.ports("socket://10.0.0.1:7101"), Level.OK)


@pytest.mark.parametrize(
    ("kernel", "newest_file_s", "level", "said"),
    [
        (KernelClock(True, 0.003), 900.0, Level.OK, "synchronised, error below 3 ms"),
        (KernelClock(True, 0.5), 900.0, Level.WARNING, "its error may be 500 ms"),
        (KernelClock(False, 16.0), 900.0, Level.WARNING, "nothing synchronises it"),
        (KernelClock(True, 0.003), 1600.0, Level.FAULT, "it is 600 s behind a file that is there already"),
    ],
)
def test_a_clock_is_judged_by_the_kernel_and_by_the_files(
    kernel: KernelClock, newest_file_s: float, level: Level, said: str
) -> None:
    assert the_one(list(clock.check(kernel, 1000.0, newest_file_s)), level).startswith(said)


def test_the_kernel_of_this_host_is_asked_as_its_own_library_lays_it_out() -> None:
    """A wrong layout of struct timex gives errors of years or below zero; 16 s is what Linux caps it at."""
    assert 0.0 <= kernel_clock().most_error_s <= 16.0


@pytest.mark.parametrize(
    ("left", "level", "said"),
    [
        (Room(20 << 30, 10**6), Level.OK, "20,480 MiB are left"),
        (Room(500 << 20, 10**6), Level.WARNING, "only 500 MiB are left"),
        (Room(3 << 20, 10**6), Level.FAULT, "3 MiB and 1000000 files are left: make room"),
        (Room(20 << 30, 0), Level.FAULT, "20,480 MiB and 0 files are left: make room"),
    ],
)
def test_a_disk_without_room_is_found(fake: FakeHost, tmp_path: Path, left: Room, level: Level, said: str) -> None:
    data = tmp_path / "data"
    data.mkdir()
    data.chmod(0o777)
    first, owner = data_folder.check(data, left, "attic", fake.host)
    assert (first.level, first.text.startswith(said)) == (level, True), first
    assert owner.text == "no program has used it yet"


def test_a_data_folder_tells_its_owner_who_holds_it_and_that_it_is_of_another_site(
    fake: FakeHost, tmp_path: Path
) -> None:
    data, enough = tmp_path / "data", Room(20 << 30, 10**6)
    with FolderLock(data, Owner("gateway", "attic", "gateway")):
        fake.lock(77, data / "owner.json")
        data.chmod(0o777)
        _, held = data_folder.check(data, enough, "attic", fake.host)
        _, here = data_folder.check(data, enough, "attic", Host())
        _, other = data_folder.check(data, enough, "cellar", fake.host)
    assert held.text == "of the gateway 'gateway' of site 'attic', in use (process 77)"
    assert here.text == f"of the gateway 'gateway' of site 'attic', in use (process {os.getpid()})"
    assert other.level == Level.FAULT and "the site file is of 'cellar'" in other.text
    data.chmod(0o700)
    assert "this user may not write it" in next(data_folder.check(data, enough, "attic", fake.host)).text
    _, free = data_folder.check(data, enough, "attic", Host())
    assert free.text.endswith("not in use")


def test_each_mistake_of_a_site_file_is_a_fault_in_its_own_words(tmp_path: Path) -> None:
    file = tmp_path / "attic.toml"
    file.write_text('site = "attic"\n[[unit]]\nname = "u1"\nseriel = 1\naddress = "/dev/x"\n')
    site, found = configuration.check_site(file)
    assert site is None
    assert [each.level for each in found] == [Level.FAULT] * 2  # serial, and no pose
    assert all(each.text.startswith(f"{file}, line ") for each in found)


def test_a_fleet_is_checked_by_noctule_deploy(tmp_path: Path) -> None:
    subprocess.run(["noctule-deploy", "init", str(tmp_path)], check=True, capture_output=True)
    found = list(configuration.check_fleet(tmp_path / "fleet.toml"))
    assert {each.level for each in found} == {Level.FAULT}
    assert any("noctule-deploy render" in each.text for each in found)


def test_certificates_that_are_not_there_and_a_router_that_is_not_are_faults(tmp_path: Path, endpoint: str) -> None:
    text = the_one(list(joining.check_certificates(tmp_path / "none", datetime.now(UTC))), Level.FAULT)
    assert "noctule-deploy render made" in text
    assert "no router answers" in the_one(list(joining.check_router([endpoint], None, 0.0)), Level.FAULT)


def test_a_router_that_answers_is_ok(router) -> None:
    assert router.endpoint in the_one(list(joining.check_router([router.endpoint], None, 60.0)), Level.OK)


def test_the_exit_status_is_that_of_the_worst_finding() -> None:
    levels = {level: Finding(level, "x", "y") for level in Level}
    assert exit_status([levels[Level.OK]]) == 0
    assert exit_status([levels[Level.OK], levels[Level.WARNING]]) == 3
    assert exit_status(list(levels.values())) == 1


def test_the_command_prints_a_line_for_each_finding(tmp_path: Path, router) -> None:
    file = tmp_path / "attic.toml"
    file.write_text("no site")
    folders = ("--data", str(file), "--data", str(tmp_path / "none"))
    command = ["noctule", "doctor", str(file), *folders, "--connect", router.endpoint]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=120)
    lines = ended.stdout.splitlines()
    assert ended.returncode == 1 and ended.stderr == ""
    assert lines[0].startswith(f"fault    site file: {file} is not a TOML file")
    assert f"ok       router: reached by {router.endpoint}" in lines
    assert f"fault    data folder {file}: is no folder: give what the service has as --data" in lines
    assert lines[-1].startswith(f"warning  data folder {tmp_path / 'none'}: is not there")
