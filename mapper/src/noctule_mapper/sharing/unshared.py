"""Sites that not every mapper was given: while all run nothing is missing, and after a failure nobody maps them."""

import logging
from collections.abc import Mapping, Sequence

_LISTED = 5

_log = logging.getLogger(__name__)


class UnsharedSites:
    """What the status says of them; the log says it once a change. For one thread."""

    def __init__(self) -> None:
        self.detail = ""  # empty while every mapper shares every site
        self.sites = 0  # that some mapper lacks

    def note(self, unshared: Mapping[str, Sequence[str]]) -> None:
        """By mapper, the sites that it does not share."""
        self.sites = len({site for sites in unshared.values() for site in sites})
        lacking = "; ".join(f"mapper {name!r} does not share {_listed(sites)}" for name, sites in unshared.items())
        detail = f"{lacking}: give every mapper the same --site options" if lacking else ""
        if detail and detail != self.detail:
            _log.warning("%s", detail)
        elif self.detail and not detail:
            _log.info("every mapper shares every site again")
        self.detail = detail


def _listed(sites: Sequence[str]) -> str:
    more = f" and {len(sites) - _LISTED} more" if len(sites) > _LISTED else ""
    return ", ".join(sites[:_LISTED]) + more
