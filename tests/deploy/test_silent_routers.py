"""A router whose host is gone without a word while a client writes to it: the client goes on with another."""

import sys
from datetime import UTC, datetime
from pathlib import Path

import pytest
from system.processes import Programs, programs, wait_until

from deploy import namespaces
from noctule_deploy import fleet_file, render
from noctule_deploy.render import Place

pytestmark = pytest.mark.usefixtures("can_have_namespaces")

ADDRESSES = {"one": "10.77.1.1", "two": "10.77.1.2", "server": "10.77.1.3"}
ROUTERS = ("one", "two")
FLEET = f"""
[[router]]
name = "one"
address = "{ADDRESSES["one"]}"

[[router]]
name = "two"
address = "{ADDRESSES["two"]}"

[[gateway]]
name = "attic"
site = "house"
units = ["u1"]

[[mapper]]
name = "cartographer"
sites = ["house"]

[[operator]]
name = "anna"
sites = ["house"]
"""
# It prints the router that it has, and writes more than the send buffer holds once the file is there, and nothing
# later: while somebody waits to write more, Zenoh closes the link by itself.
WRITE = """
import sys, time
from pathlib import Path
import zenoh
from noctule import bus, keys

with bus.closing(bus.open_session()) as session:
    block = zenoh.CongestionControl.BLOCK
    publisher = session.declare_publisher(keys.contour("house"), congestion_control=block)
    written = False
    while True:
        if Path(sys.argv[1]).exists() and not written:
            publisher.put(bytes(150_000))
            written = True
        print(publisher.matching_status.matching, *session.info.routers_zid(), flush=True)
        time.sleep(0.1)
"""
# It prints the router that it reads through.
READ = """
import sys, threading
from noctule import bus, keys

with bus.closing(bus.open_session([sys.argv[1]])) as session:
    session.declare_subscriber(keys.contour("house"), lambda sample: None)
    print(*session.info.routers_zid(), flush=True)
    threading.Event().wait()
"""


def test_a_client_whose_send_buffer_is_full_leaves_a_router_that_is_gone_without_a_word(tmp_path: Path) -> None:
    (tmp_path / "fleet.toml").write_text(FLEET)
    made = Place(tmp_path / "rendered", tmp_path / "ca")
    render.render(fleet_file.load(tmp_path / "fleet.toml"), made, datetime.now(UTC))
    with namespaces.network() as network, programs(tmp_path) as running:

        def start(name: str, host: str, subject: str, *command: str) -> None:
            environment = {"NOCTULE_TLS": str(made.out / f"{subject}.g1")}
            running.start(name, *network.within(host, *command), env=environment)

        for host, address in ADDRESSES.items():
            network.add(host, address)
            network.plug(host)
        for router in ROUTERS:
            start(router, router, f"router.{router}", "noctule-gateway", "router")
            wait_until(lambda router=router: "listens" in running.log(router), "the router does not listen")
            reader = (sys.executable, "-c", READ, f"tls/{ADDRESSES[router]}:7447")
            start(f"reader-{router}", router, "operator.anna", *reader)
        cut = tmp_path / "cut"
        start("writer", "server", "mapper.cartographer", sys.executable, "-c", WRITE, str(cut))
        first = wait_until(lambda: joined(running), "the client has no router through which somebody reads")
        reads = {
            router: wait_until(lambda router=router: reads_through(running, router), "it does not read")
            for router in ROUTERS
        }
        (gone,) = [router for router, its_id in reads.items() if its_id == first]
        network.pull(gone)
        running.kill(gone)
        running.kill(f"reader-{gone}")
        cut.touch()
        wait_until(lambda: joined(running) not in ("", first), "the client does not leave the router")


def joined(running: Programs) -> str:
    """The router that the client has now, through which somebody reads; empty while there is none."""
    matching, _, router = (running.log("writer").rstrip("\n").splitlines() or [""])[-1].partition(" ")
    return router if matching == "True" else ""


def reads_through(running: Programs, router: str) -> str:
    """The id of the router that the reader of its host is joined to; empty while there is none."""
    return running.log(f"reader-{router}").strip()
