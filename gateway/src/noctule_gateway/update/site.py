"""The update of several units at once, each on its own line and thread."""

import random
import time
from collections.abc import Callable, Sequence

from noctule.site import Unit
from noctule_gateway.line.line import Line
from noctule_gateway.update.image import Image
from noctule_gateway.update.updater import Updater
from noctule_gateway.wire.frames import MAX_REQUEST

_SHOW_EVERY_S = 0.1


class UnitUpdate:
    """The update of one unit; its ``updater`` says how far it is and how it ended."""

    def __init__(self, unit: Unit, image: Image, again: bool) -> None:
        self.unit = unit
        self.updater = Updater(unit.serial, image, again, random.randrange(MAX_REQUEST))
        self._line = Line(unit.address, self.updater, unit.name)

    def start(self) -> None:
        """Open the line and begin."""
        self._line.start()

    def close(self) -> None:
        """Let the line go, wherever the update is."""
        self._line.stop()
        self._line.join()


def update_units(
    units: Sequence[Unit], image: Image, again: bool, watch: Callable[[Sequence[UnitUpdate]], None]
) -> Sequence[UnitUpdate]:
    """Update ``units`` until each has ended; ``watch`` is called ten times a second, and once at the end."""
    updates = [UnitUpdate(unit, image, again) for unit in units]
    try:
        for update in updates:
            update.start()
        while any(update.updater.outcome is None for update in updates):
            watch(updates)
            time.sleep(_SHOW_EVERY_S)
        watch(updates)
    finally:
        for update in updates:
            update.close()
    return updates
