"""An audit log as tests write and read it."""

import json
import time
from pathlib import Path

from noctule.caller import Who
from noctule_gateway.audit import lines
from noctule_gateway.audit.allowance import COMMANDS, Keeping
from noctule_gateway.audit.audit_log import AuditLog
from noctule_gateway.audit.look import AuditLook, look_at_audit

ANNA = Who("operator.anna.g1", signed=True)


def close(log: AuditLog) -> None:
    log.end()
    log.close(time.monotonic() + 60)


def record(folder: Path, count: int, keeping: Keeping = COMMANDS) -> AuditLog:
    """What one run of a gateway records."""
    log = AuditLog(folder, {"site": "house"}, keeping)
    for number in range(count):
        log.append({"event": "given", "command": "stop", "request_id": f"r{number}"}).result(60)
    close(log)
    return log


def look(folder: Path) -> AuditLook:
    (found,) = look_at_audit(folder)
    return found


def facts(folder: Path, family: str = "audit") -> list[lines.Facts]:
    return [json.loads(line) for _, path in lines.files(folder, family) for line in path.read_bytes().splitlines()]
