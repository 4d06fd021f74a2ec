"""What can go wrong between a unit and the bus: each error says what was wrong, where, and what to do."""

from noctule.errors import NoctuleError


class GatewayError(NoctuleError):
    """Base of the gateway's own errors."""


class FrameError(GatewayError):
    """Bytes that are not a frame, or a frame that can't be made."""


class WrongUnitError(GatewayError):
    """The unit on the line is not the one that the site file names there, or speaks another protocol."""


class LineError(GatewayError):
    """The line to a unit can't be opened or was cut."""


class CommandError(GatewayError):
    """A unit did not carry out a command."""


BEING_UPDATED = "the unit is being updated: wait until that is over, its status says how far it is"


class UnderWayError(CommandError):
    """A unit takes no command because it is being updated."""

    def __init__(self) -> None:
        super().__init__(BEING_UPDATED)


class ImageError(GatewayError):
    """A file is not an image that a unit can be updated with."""


class RefusedImageError(ImageError):
    """A sound image that this gateway's rules do not allow: who signed it, or its version."""


class UpdateError(GatewayError):
    """A unit could not be updated. It has its old application, the new one, or waits in its loader for another try."""


class HardwareError(UpdateError):
    """The image was made for other hardware than the unit's."""


class UnitGoneError(UpdateError):
    """The unit has stopped answering, or does not come back."""


class FlashError(UpdateError):
    """The unit's flash does not hold what it was given."""


class LogError(GatewayError):
    """A unit's log can't be opened, read or written."""


class DamagedError(LogError):
    """A unit's log holds what was never written there, or lacks what was: it is to be rebuilt from what is sound."""

    def __init__(self, log: object, reason: str) -> None:
        super().__init__(f"log {log} is damaged: {reason}")
        self.reason = reason


class AuditError(GatewayError):
    """What was commanded can't be recorded, or a line of the audit log is not what was written."""
