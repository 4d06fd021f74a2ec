"""Rows of array dataclasses: taken and joined field by field, those of nested ones too."""

from dataclasses import dataclass, field

import numpy as np

from noctule_mapper.readings import arrays


@dataclass(frozen=True)
class Inner:
    x_m: np.ndarray


@dataclass(frozen=True)
class Outer:
    inner: Inner
    kind: np.ndarray
    span_m: float = field(metadata=arrays.SHARED)

    take = arrays.take


def outer(first: int, last: int, span_m: float = 4.0) -> Outer:
    numbers = np.arange(first, last)
    return Outer(Inner(numbers / 10), numbers, span_m)


def test_rows_are_taken_by_number_mask_and_slice_and_what_they_share_stays() -> None:
    for index in (np.array([1, 3]), np.array([False, True, False, True]), slice(1, 4, 2)):
        taken = outer(0, 4).take(index)
        assert taken.kind.tolist() == [1, 3]
        assert taken.inner.x_m.tolist() == [0.1, 0.3]
        assert taken.span_m == 4.0


def test_a_tuple_takes_from_arrays_of_two_dimensions() -> None:
    square = Inner(np.arange(6).reshape(2, 3))
    pairs = arrays.take(square, (np.array([0, 1]), np.array([2, 0]), np.newaxis))
    assert pairs.x_m.tolist() == [[2], [3]]


def test_parts_are_joined_in_their_order_and_share_what_the_first_has() -> None:
    joined = arrays.join([outer(5, 7, 3.0), outer(0, 1, 9.0)])
    assert joined.kind.tolist() == [5, 6, 0]
    assert joined.inner.x_m.tolist() == [0.5, 0.6, 0.0]
    assert joined.span_m == 3.0
