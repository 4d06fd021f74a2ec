"""What can be wrong with mappers that share sites."""

from noctule.errors import NoctuleError


class SharingError(NoctuleError):
    """Sites that can't be shared as this mapper is told to."""
