"""The log of a program that runs for months says each day that its certificate expires soon."""

import logging
from datetime import date, datetime

from noctule import tls

_log = logging.getLogger(__name__)


class ExpiryWatch:
    """Of the certificate that a program joins the bus with; of none, nothing is said."""

    def __init__(self, identity: tls.Identity | None) -> None:
        self._identity = identity
        self._said: date | None = None

    def look(self, now: datetime) -> str:
        """The alarm, empty where there is none. The first look of a day logs it. ``now`` is UTC."""
        alarm = self._identity.expiry_alarm(now) if self._identity else ""
        if alarm and now.date() != self._said:
            _log.warning("%s", alarm)
            self._said = now.date()
        return alarm
