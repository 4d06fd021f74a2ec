"""What a client takes from the bus: messages within their bounds that fit the key they came on."""

from collections.abc import Collection
from typing import TypeVar

import zenoh
from google.protobuf.message import Message

from noctule import bounds, keys
from noctule.errors import BoundsError, BusError, KeyFormatError
from noctule.messages_pb2 import ServiceStatus, Sweep, UnitStatus
from noctule.newer_fields import NewerFields
from noctule.refusals import Refusals

M = TypeVar("M", bound=Message)


class Intake:
    """Decodes and checks messages; counts the ``refusals``, and those with fields of a ``newer`` version."""

    def __init__(self) -> None:
        self.refusals = Refusals()
        self.newer = NewerFields()

    def accepted(self, message_type: type[M], sample: zenoh.Sample) -> M | None:
        """The message, or None where it is refused, which is counted and logged."""
        try:
            return self.decode(message_type, sample)
        except (BusError, KeyFormatError) as error:
            self.refusals.note(str(sample.key_expr), error)
            return None

    def decode(self, message_type: type[M], sample: zenoh.Sample, but: Collection[str] = ()) -> M:
        """The message; raises BusError where it does not fit the bounds or the key that it came on."""
        payload = sample.payload.to_bytes()
        try:
            message = bounds.decode(message_type, payload, but)
        except BoundsError as error:
            raise BusError(f"{sample.key_expr}: {error}") from error
        if isinstance(message, Sweep | UnitStatus):
            _check_unit(message, keys.parse_unit(str(sample.key_expr)))
        if isinstance(message, ServiceStatus):
            _check_service(message, *keys.parse_service_status(str(sample.key_expr)))
        self.newer.note(message, payload)
        return message


def _check_unit(message: Sweep | UnitStatus, key: keys.UnitKey) -> None:
    if message.unit != key.unit or message.site not in ("", key.site):
        said = f"unit {message.unit!r} of site {message.site!r}"
        raise BusError(f"a {message.DESCRIPTOR.name} of {said} came on a key of unit {key.unit!r} of site {key.site!r}")


def _check_service(message: ServiceStatus, site: str, service: str) -> None:
    if message.name not in ("", service) or message.site not in ("", site):
        said = f"{message.name!r} of site {message.site!r}"
        raise BusError(f"a ServiceStatus of {said} came on the key of service {service!r} of site {site!r}")
