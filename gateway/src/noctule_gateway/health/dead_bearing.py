"""One bearing that never answers again, while both its neighbours hear one reflector on either side of it.

A reflector that the neighbours hear within the lobe answers between them too, whatever is moved in the room: so only
the unit can be at fault. Of echoes 8 % are lost, so that a bearing is silent seven times in a row by chance once in
0.08^-7 = 5e7 sweeps; of forty bearings one, once in 1e6. A map loses nothing by it: the sweeps stay.
"""

import math

from noctule import messages_pb2 as messages
from noctule_gateway.health.past import Past
from noctule_gateway.health.readings import Readings
from noctule_gateway.health.suspicion import Suspicion

NAMED_AFTER = 7  # silences in a row
_USUAL_SHARE = 0.8
_ALIKE_M = 0.05
_NEIGHBOURS_RAD = math.radians(10.0)  # from one to the other: well inside the lobe


class DeadBearings:
    """Counts by bearing how often it was silent in a row while it should have answered."""

    def __init__(self) -> None:
        self._silent: dict[int, int] = {}
        self.named: tuple[int, ...] = ()  # the bearings that the sweep before shows to be dead

    def restart(self) -> None:
        """The plan or the pose is another."""
        self._silent, self.named = {}, ()

    def suspicions(self, sweep: Readings, past: Past) -> list[Suspicion]:
        """The bearings that have been silent long enough."""
        found = []
        for number in range(1, len(sweep.range_m) - 1):
            # A past that has learnt of the first silences must not end the count. One that knows only a few sweeps must
            # not begin it: a corner that answers now and then may have answered in each of these.
            usual = self._silent.get(number) or (past.is_full and past.heard_share[number] >= _USUAL_SHARE)
            if not usual or not self._between_alike(sweep, past, number):
                if not math.isnan(sweep.range_m[number]):
                    self._silent.pop(number, None)
                continue
            silent = math.isnan(sweep.range_m[number])
            self._silent[number] = self._silent.get(number, 0) + 1 if silent else 0
            if self._silent[number] >= NAMED_AFTER:
                found.append(number)
        self.named = tuple(found)
        if not found:
            return []
        listed = ", ".join(f"{math.degrees(sweep.bearing_rad[number]):.0f}" for number in found)
        nats = NAMED_AFTER * math.log(1 / 0.08)
        words = f"no echo any more at {listed} degrees, though its neighbours hear the same reflector"
        return [Suspicion(messages.FAULT_KIND_BEARING_SILENT, nats, words)]

    @staticmethod
    def _between_alike(sweep: Readings, past: Past, number: int) -> bool:
        before_m, after_m = sweep.range_m[number - 1], sweep.range_m[number + 1]
        if math.isnan(before_m) or math.isnan(after_m):
            return False
        near = sweep.bearing_rad[number + 1] - sweep.bearing_rad[number - 1] <= _NEIGHBOURS_RAD
        return near and all(abs(one_m - past.median_m[number]) <= _ALIKE_M for one_m in (before_m, after_m))
