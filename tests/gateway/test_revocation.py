"""A running gateway takes in that an operator's certificate was revoked; real certificates, a real router."""

import json
from datetime import UTC, datetime
from pathlib import Path

import zenoh
from deploy.secured_fleet import rendered
from gateway.serving import FIXED, SITE, site_file

from noctule import caller, keys
from noctule.messages_pb2 import CommandRequest
from noctule.site import load
from noctule_deploy import fleet_file, render
from noctule_gateway.service import Gateway

NOBODY = "socket://127.0.0.1:9"


def test_a_running_gateway_refuses_a_revoked_operators_commands_and_records_them(
    tmp_path: Path, router: zenoh.Session
) -> None:
    made = rendered(tmp_path)
    key = keys.rpc(SITE, "u1", "single")

    def refusal(request_id: str) -> str:
        """Why anna's first certificate commands nothing; empty if the command reached the unit's server."""
        payload = CommandRequest(request_id=request_id).SerializeToString()
        signed = caller.attachment("", made.folder("operator.anna.g1"), key, payload)
        (reply,) = router.get(key, payload=payload, attachment=signed, timeout=60)
        return "" if reply.err is None else reply.err.payload.to_string()

    gateway = Gateway(load(site_file(tmp_path, ("u1", 7, NOBODY, FIXED))), tmp_path / "data")
    try:
        gateway.start()
        gateway.join(router, tls_folder=made.folder("gateway.attic.g1"))
        gateway.report()
        assert refusal("before") == ""
        render.revoke(fleet_file.load(made.file), made.place, "operator.anna", datetime.now(UTC))
        gateway.report()
        assert "operator.anna.g1, which was revoked" in refusal("after")
    finally:
        gateway.close()
    recorded = [json.loads(line) for line in (tmp_path / "data" / "refused-1.jsonl").read_text().splitlines()[1:]]
    assert [(each["who"], each["signed"], each["request_id"]) for each in recorded] == [
        ("operator.anna.g1", False, "after")
    ]
