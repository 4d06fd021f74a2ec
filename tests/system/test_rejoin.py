"""A router that was started again: every program is back on its bus within ten seconds."""

import time
from pathlib import Path
from threading import Event

import zenoh
from system.processes import Programs, free_ports, programs, wait_until, within_pauses
from system.test_one_owner import gateway, mapper
from system.test_operations import viewer

from noctule import bus
from noctule.client import Client

SITE = "attic"
OUTAGE_S = 5.0  # by then every program waits as long between two attempts as it ever does
WITHIN_S = 10.0
STAYS_S = 8.0  # longer than the sessions that services open to read what they publish
PROGRAMS = ("gateway", "mapper", "replay", "record", "watch", "viewer")


def start_all(running: Programs, folder: Path, endpoint: str) -> None:
    connect = ("--connect", endpoint)
    scan = folder / "wall.csv"
    scan.write_text("angle,range\n-5,1.5\n0,1.5\n5,1.5\n")
    columns = ("--angle", "angle", "--range", "range", "--units", "m")
    running.start("import", "noctule", "import", str(scan), *columns)
    running.start("gateway", *gateway(folder, folder / "gateway", SITE)[:-2], *connect)
    running.start("mapper", *mapper(folder / "mapper", SITE)[:-4], *connect, "--rerun", "none")
    running.start("record", "noctule", "record", SITE, str(folder / "record.jsonl"), *connect)
    running.start("watch", "noctule", "watch", SITE, "--json", *connect)
    running.start("viewer", *viewer(), "--site", SITE, *connect)
    assert running.wait("import") == 0, running.log("import")
    running.start("replay", "noctule", "replay", str(folder / "wall.jsonl"), "--site", SITE, "--speed", "max", *connect)


def sessions(router: zenoh.Session) -> set[str]:
    return {str(transport.zid) for transport in router.info.transports()}


def sessions_that_stay(router: zenoh.Session, running: Programs) -> set[str]:
    """The session of each program; services open others for seconds, to read what they publish."""
    seen: set[str] = set()
    since_s = 0.0

    def stay() -> bool:
        nonlocal seen, since_s
        running.check()
        now = sessions(router)
        if len(seen & now) < len(PROGRAMS):
            seen, since_s = now, time.monotonic()
        seen = seen & now
        return len(seen) == len(PROGRAMS) and time.monotonic() - since_s > STAYS_S

    wait_until(stay, "not all have joined")
    return seen


def test_every_program_is_back_within_ten_seconds_of_the_routers_return(tmp_path: Path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_ports(1)[0]}"
    with programs(tmp_path) as running:
        with bus.open_session(listen=[endpoint]) as router:
            start_all(running, tmp_path, endpoint)
            joined = sessions_that_stay(router, running)
        Event().wait(OUTAGE_S)
        printed = len(running.log("watch").splitlines())
        with bus.open_session(listen=[endpoint]) as router, Client(SITE, session=router) as client:
            began_s = time.monotonic()

            def is_back() -> bool:
                running.check()
                watched = len(running.log("watch").splitlines()) - printed
                return joined <= sessions(router) and client.units() == {"u1", "scanner"} and watched > 1

            within_pauses(is_back, "not all are back", WITHIN_S)
            print(f"all are back after {time.monotonic() - began_s:.1f} s")
