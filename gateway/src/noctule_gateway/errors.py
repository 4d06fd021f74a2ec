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


class LogError(GatewayError):
    """A unit's log can't be opened, read or written."""
