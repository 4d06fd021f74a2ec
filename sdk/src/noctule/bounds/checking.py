"""Holds messages against the table."""

from collections.abc import Collection
from typing import Any, TypeVar

from google.protobuf.message import DecodeError, Message

from noctule.bounds.kinds import Counts, Many, Number
from noctule.bounds.table import BOUNDS, PAYLOAD_BYTES, SMALL_BYTES
from noctule.errors import BoundsError

M = TypeVar("M", bound=Message)


def decode(message_type: type[M], payload: bytes, but: Collection[str] = ()) -> M:
    """The message in ``payload``, checked. Raises BoundsError."""
    described = message_type.DESCRIPTOR
    most = PAYLOAD_BYTES.get(described.name, SMALL_BYTES)
    if len(payload) > most:
        raise BoundsError(f"not a {described.full_name}: it has {len(payload)} bytes, and {most} are allowed")
    try:
        message = message_type.FromString(payload)
    except DecodeError as error:
        raise BoundsError(f"not a {described.full_name}: {error}") from error
    check(message, but)
    return message


def check(message: Message, but: Collection[str] = ()) -> None:
    """Raise BoundsError at the first value beyond its bounds, which it names by its path (``readings[3].bearing_rad``).

    The messages in the fields ``but`` are left to the caller, so that one of them alone can be refused.
    """
    if fault := _fault(message, but):
        raise BoundsError(fault)


def _fault(message: Message, but: Collection[str] = ()) -> str:
    """The path of the first value beyond its bounds and what is wrong with it; empty if nothing is."""
    bounds = BOUNDS.get(message.DESCRIPTOR.name, {})
    for field, value in message.ListFields():
        bound = bounds.get(field.name)
        if type(bound) is Number:  # most are, and this runs for every reading
            if not bound.least <= value <= bound.most:
                return f"{field.name} {bound.fault(value)}"
        elif isinstance(bound, Many | Counts):
            if len(value) > bound.most:
                return f"{field.name} has {len(value)} elements, and {bound.most} are allowed"
            if field.name not in but and (fault := _fault_inside(value, bound)):
                return field.name + fault
        elif bound is not None:
            if fault := bound.fault(value):
                return f"{field.name} {fault}"
        elif isinstance(value, Message) and (fault := _fault(value)):
            return f"{field.name}.{fault}"
    return ""


def _fault_inside(elements: Any, bound: Many | Counts) -> str:
    if isinstance(bound, Counts):
        for key, element in elements.items():
            if fault := bound.name.fault(key):
                return f"'s name {fault}"
            if fault := bound.each.fault(element):
                return f"[{key!r}] {fault}"
        return ""
    for index, element in enumerate(elements):
        if fault := _fault(element) if bound.each is None else bound.each.fault(element):
            return f"[{index}]{'.' if bound.each is None else ' '}{fault}"
    return ""
