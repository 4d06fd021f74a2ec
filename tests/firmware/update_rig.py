"""An update of a stepped unit by the gateway's Updater, in the time of the simulation."""

from collections.abc import Callable
from dataclasses import dataclass, field

from firmware.stepped_unit import SteppedUnit
from noctule_gateway.errors import GatewayError
from noctule_gateway.update import Updater
from noctule_gateway.update_image import Image
from noctule_gateway.update_steps import Current, Updated

SERIAL = 1  # noctule-sim's first unit


def clean(data: bytes) -> bytes:
    """A line that changes nothing."""
    return data


@dataclass
class Line:
    """What happens to the bytes of each direction."""

    to_unit: Callable[[bytes], bytes] = field(default=clean)
    to_host: Callable[[bytes], bytes] = field(default=clean)


def update(
    unit: SteppedUnit,
    image: Image,
    again: bool = False,
    line: Line | None = None,
    first_request: int = 1,
) -> Updated | Current | GatewayError:
    """Take the unit to ``image``, or to where that ends."""
    line = line or Line()
    updater = Updater(SERIAL, image, again, first_request)
    updater.opened(unit.now_s)
    while updater.outcome is None:
        updater.advance(unit.now_s)
        feed = line.to_unit(updater.output(unit.now_s)).hex()
        sent = unit.step(feed=[feed], until_s=max(updater.next_s, unit.now_s), stop_at_frame=True)
        updater.receive(line.to_host(sent), unit.now_s)
    return updater.outcome
