"""One site of the paper's room on a test's own ports: the commands that run its parts, as a user would type them."""

from dataclasses import dataclass
from pathlib import Path

from system.processes import ROOT, Programs, free_ports, wait_until

from noctule.client import Client
from noctule.messages_pb2 import Contour

SITE = "paper-room"
SURVEY_SWEEPS = 44  # waypoints of the paper's path at 20 cm: two sides of 14 steps, two of 8


@dataclass(frozen=True)
class PaperRoom:
    """Folder and ports of a running site."""

    folder: Path
    unit_port: int
    zenoh_port: int

    @property
    def connect(self) -> str:
        """The endpoint that clients of the bus connect to."""
        return f"tcp/127.0.0.1:{self.zenoh_port}"

    def simulator(self, speed: int) -> list[str]:
        """The unit, carried once around the room at ``speed`` times real time."""
        firmware = "firmware/build/noctule.ihx"
        address = f"127.0.0.1:{self.unit_port}"
        options = f"--room paper --speed {speed} --seed 7 --exact-clocks"
        return f"noctule-sim --firmware {firmware} --tcp {address} {options}".split()

    def gateway(self) -> list[str]:
        """The gateway, which is the site's Zenoh router too."""
        return [
            *("noctule-gateway", "run", str(self.folder / "site.toml")),
            *("--data", str(self.folder / "gateway"), "--listen", self.connect),
        ]

    def mapper(self, rerun: str = "none") -> list[str]:
        """The mapper, showing what it does at the ``rerun`` address."""
        return [
            *("noctule-mapper", "run", "--site", SITE, "--data", str(self.folder / "mapper")),
            *("--connect", self.connect, "--rerun", rerun),
        ]


def paper_room(folder: Path) -> PaperRoom:
    """A site with a unit on a free port, like the demo's."""
    unit_port, zenoh_port = free_ports(2)
    text = (ROOT / "deploy/demo/sites/paper.toml").read_text()
    (folder / "site.toml").write_text(text.replace("127.0.0.1:7101", f"127.0.0.1:{unit_port}"))
    return PaperRoom(folder, unit_port, zenoh_port)


def wait_for_sweeps(room: PaperRoom, running: Programs, count: int) -> None:
    """Wait until the unit's log at the gateway holds that many sweeps."""

    def logged() -> bool:
        running.check()
        return any(status.log_head >= count for status in client.unit_statuses())

    with Client(SITE, connect=[room.connect]) as client:
        wait_until(logged, f"fewer than {count} sweeps in the log")


def wait_for_contour(room: PaperRoom, running: Programs) -> Contour:
    """The first contour that rests on the whole survey."""

    def whole() -> Contour | None:
        running.check()
        contour = client.contour()
        return contour if contour is not None and contour.sweeps >= SURVEY_SWEEPS else None

    with Client(SITE, connect=[room.connect]) as client:
        return wait_until(whole, "no contour of the whole survey")
