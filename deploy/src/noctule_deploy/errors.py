"""What goes wrong with a fleet, in words that say what to do."""

from noctule.errors import NoctuleError


class FleetFileError(NoctuleError):
    """A fleet file that can't be read or does not make sense; the message names file, table and key."""


class RenderError(NoctuleError):
    """A folder of rendered files that can't be used or written."""
