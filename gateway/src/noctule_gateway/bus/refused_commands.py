"""Commands of one unit that were refused on the bus: recorded, with who claims to have given them and why."""

from noctule.caller import Who
from noctule_gateway.audit.audit_log import AuditLog

_LONGEST_COMMAND = 64  # characters; a stranger may ask under any key
_LONGEST_REASON = 300


class RefusedCommands:
    """Records refusals in ``audit``, a log of their own: so a flood of them washes out nothing that was done."""

    def __init__(self, audit: AuditLog, unit: str) -> None:
        self._audit, self._unit = audit, unit

    def note(self, command: str, request_id: str, who: Who, why: str) -> None:
        """A command was refused. Where ``who`` is not signed, it is only what the client says of itself."""
        self._audit.append(
            {
                "event": "refused",
                "who": who.name,
                "signed": who.signed,
                "unit": self._unit,
                "command": command[:_LONGEST_COMMAND],
                "request_id": request_id,
                "error": why[:_LONGEST_REASON],
            }
        )
