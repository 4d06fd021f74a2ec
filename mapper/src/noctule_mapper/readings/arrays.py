"""Dataclasses whose arrays have a row for each item: some of the rows, and several such sets as one."""

from collections.abc import Sequence
from dataclasses import fields, replace
from functools import cache
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Rows = TypeVar("Rows", bound="DataclassInstance")
Index = np.ndarray | slice | tuple[Any, ...]

SHARED = {"shared": True}  # the metadata of a field that all rows have in common


def take(rows: Rows, index: Index) -> Rows:
    """The rows at ``index``: numbers, a mask, a slice, or a tuple of these for arrays of more dimensions.

    ``take = arrays.take`` in a dataclass makes it a method. A field with the metadata SHARED stays as it is.
    """
    if isinstance(index, np.ndarray) and index.dtype == bool:
        index = np.nonzero(index)  # once, not for every field
    fields_of, taken = vars(rows), object.__new__(type(rows))  # whose fields are in order already: nothing to check
    of_taken = vars(taken)
    for name in _names(type(rows)):
        of_taken[name] = _rows_at(fields_of[name], index)
    for name in _shared(type(rows)):
        of_taken[name] = fields_of[name]
    return taken


def join(parts: Sequence[Rows]) -> Rows:
    """Several sets as one, in their order, at least one; SHARED fields are those of the first."""
    first = parts[0]
    return replace(
        first, **{name: _end_to_end([getattr(part, name) for part in parts]) for name in _names(type(first))}
    )


@cache  # a fit asks a thousand times
def _names(kind: type["DataclassInstance"]) -> list[str]:
    return [field.name for field in fields(kind) if "shared" not in field.metadata]


@cache
def _shared(kind: type["DataclassInstance"]) -> list[str]:
    return [field.name for field in fields(kind) if "shared" in field.metadata]


def _rows_at(value: Any, index: Index) -> Any:
    return value[index] if isinstance(value, np.ndarray) else take(value, index)


def _end_to_end(values: Sequence[Any]) -> Any:
    return np.concatenate(values) if isinstance(values[0], np.ndarray) else join(values)
