"""What can be wrong with mappers that share sites."""

from noctule.errors import NoctuleError


class SharingError(NoctuleError):
    """Sites that this mapper can't share."""
