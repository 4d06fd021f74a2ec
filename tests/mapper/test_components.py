"""Our connected components are SciPy's, whose graphs take too long to load."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components as of_scipy

from noctule_mapper.readings.components import connected_components


@st.composite
def graphs(draw: st.DrawFn) -> tuple[list[int], list[int], int]:
    count = draw(st.integers(1, 30))
    ends = st.lists(st.tuples(st.integers(0, count - 1), st.integers(0, count - 1)), max_size=40)
    links = draw(ends)
    return [first for first, _ in links], [second for _, second in links], count


@given(graphs())
def test_they_are_those_of_scipy_in_the_same_order(graph: tuple[list[int], list[int], int]) -> None:
    first, second, count = graph
    linked = coo_matrix((np.ones(len(first), bool), (first, second)), (count, count))
    assert connected_components(first, second, count).tolist() == of_scipy(linked, directed=False)[1].tolist()


@pytest.mark.parametrize("count", [0, 1, 20000])
def test_a_chain_of_any_length_is_one_component(count: int) -> None:
    shuffled = np.random.default_rng(1).permutation(count)
    assert connected_components(shuffled[:-1], shuffled[1:], count).tolist() == [0] * count
