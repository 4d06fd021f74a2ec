"""What comes over a line on which the unit does not answer: nothing, what can't be read, or what answers nothing."""

from dataclasses import replace

from noctule_gateway.link.events import LinkCounts
from noctule_gateway.status.unit_state import UnitState


class Hearing:
    """What has come since begin(), which is called when a line is opened and when its unit ceases to answer."""

    def __init__(self, address: str) -> None:
        self._address = address
        self._something_came = False
        self._frames_before = 0
        self._last_s = 0.0
        self._told = ""

    def opened(self, now_s: float) -> None:
        """The line is open."""
        self._last_s = now_s

    def begin(self, counts: LinkCounts) -> str:
        """Why the unit can't be asked, until more is known."""
        self._something_came, self._frames_before = False, _frames(counts)
        self._told = self.words(counts)
        return self._told

    def heard(self, now_s: float) -> None:
        """Something has come."""
        self._something_came, self._last_s = True, now_s

    def silent_s(self, now_s: float) -> float:
        """For how long nothing has come."""
        return now_s - self._last_s

    def words(self, counts: LinkCounts) -> str:
        """Why the unit can't be asked, for the operator."""
        if not self._something_came:
            return f"no answer on {self._address}"
        if _frames(counts) == self._frames_before:
            return f"what comes on {self._address} can't be read: another device, or another baud rate?"
        return (
            f"no answer on {self._address}, though frames come: check the wire to the unit, and whether the line "
            "sends back what it is sent"
        )

    def up_to_date(self, state: UnitState, counts: LinkCounts) -> UnitState:
        """The state with what is known by now, if the unit's silence is its trouble."""
        if not self._told or state.trouble != self._told:
            return state
        self._told = self.words(counts)
        return replace(state, trouble=self._told)


def _frames(counts: LinkCounts) -> int:
    return counts.frames_read + counts.frames_unknown
