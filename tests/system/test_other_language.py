"""A subscriber in Rust that knows only the keys decodes what a real gateway publishes, by the schemas on the bus."""

import json
import os
import subprocess
from pathlib import Path

import pytest
from google.protobuf import json_format
from system.processes import ROOT, programs, wait_until
from system.site import SITE, paper_room

from noctule import Client, keys
from noctule.messages_pb2 import Sweep

CRATE = ROOT / "sdk/examples/watch_any"


@pytest.mark.soak  # building Zenoh takes about 3 minutes of two cores, once
@pytest.mark.timeout(1800)
def test_a_subscriber_in_rust_decodes_sweeps_and_statuses_by_their_schemas(tmp_path: Path) -> None:
    target = Path(os.environ.get("CARGO_TARGET_DIR", CRATE / "target"))
    build = ["sh", "deploy/cargo.sh", "build", "--locked", "--manifest-path", str(CRATE / "Cargo.toml")]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    room = paper_room(tmp_path)
    with programs(tmp_path) as running:
        running.start("gateway", *room.gateway())
        with Client(SITE, connect=[room.connect]) as client:
            running.start("rust", str(target / "debug/watch-any"), f"noctule/@v1/{SITE}/**", room.connect)
            running.start("simulator", *room.simulator(speed=16))

            def lines_of(message: str) -> list[dict]:
                running.check()
                printed = running.log("rust").split("\n")[:-1]  # what follows the last line's end is not whole
                return [line for line in map(json.loads, printed) if line["message"] == message]

            sweeps = wait_until(lambda: lines_of("noctule.v1.Sweep")[:3], "no sweeps")
            wait_until(lambda: lines_of("noctule.v1.UnitStatus"), "no statuses")
            logged = {sweep.log_sequence: sweep for sweep in client.history("u1")}
    for line in sweeps:
        decoded = json_format.ParseDict(line["value"], Sweep())
        assert line["key"] == keys.sweep(SITE, "u1")
        assert decoded == logged[decoded.log_sequence]
