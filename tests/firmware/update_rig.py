"""An update of a stepped unit by the gateway's Updater, in the time of the simulation."""

from math import inf

from firmware.stepped_unit import SteppedUnit

from noctule_gateway.errors import GatewayError
from noctule_gateway.update.image import Image
from noctule_gateway.update.outcome import Current, Step, Updated
from noctule_gateway.update.updater import Updater

SERIAL = 1  # noctule-sim's first unit
STAGING = 0x8000  # firmware/README.md, Flash
LOOK_EVERY_S = 0.05  # at the flash, which takes longer from a reset to a frame
TICK_S = 1e-6  # so that what is due then is, whatever the simulator's rounding


class Update:
    """The update of ``unit`` to ``image``, which begins when it is run."""

    def __init__(self, unit: SteppedUnit, image: Image, again: bool = False) -> None:
        self._unit = unit
        self._updater = Updater(SERIAL, image, again, first_request=1)
        self._updater.opened(unit.now_s)

    def run(
        self, until_operation: float = inf, until_step: Step | None = None
    ) -> Updated | Current | GatewayError | None:
        """How it ends; None if the unit's flash, or the update, has got as far as that before."""
        while self._updater.outcome is None:
            if self._unit.truth.get("flash_operations", 0) >= until_operation:
                return None
            if self._updater.progress.step is until_step:
                return None
            self._exchange()
        return self._updater.outcome

    def _exchange(self) -> None:
        unit, updater = self._unit, self._updater
        updater.advance(unit.now_s)
        if updater.outcome is not None:
            return
        feed = updater.output(unit.now_s).hex()
        due_s = max(unit.now_s, min(updater.next_s, unit.now_s + LOOK_EVERY_S))
        sent = unit.step(feed=[feed], until_s=due_s + TICK_S, stop_at_frame=True)
        updater.receive(sent, unit.now_s)


def staged(image: Image) -> dict[int, bytes]:
    """What ``image`` is in a unit's staging, by address."""
    return {STAGING + 512 * page: content for page, content in image.pages.items()}


def update(unit: SteppedUnit, image: Image, again: bool = False) -> Updated | Current | GatewayError | None:
    """Take the unit to ``image``, or to where that ends."""
    return Update(unit, image, again).run()
