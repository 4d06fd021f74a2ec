"""Our assignments cost no more than SciPy's, which takes too long to load."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from noctule_mapper.contour.assignment import assignment


@st.composite
def costs(draw: st.DrawFn) -> np.ndarray:
    """As of links between walls: any, negative, equal and infinite ones, and as many open ends at one price."""
    count = draw(st.integers(1, 9))
    price = st.one_of(st.floats(-20, 20), st.integers(-2, 2).map(float), st.just(np.inf))
    drawn = draw(st.lists(price, min_size=count * count, max_size=count * count))
    open_ends = np.full((count, count), draw(st.floats(-5, 10)))
    return np.hstack([np.array(drawn).reshape(count, count), open_ends])


@given(costs())
def test_they_cost_no_more_than_those_of_scipy(cost: np.ndarray) -> None:
    columns = assignment(cost)
    assert len(set(columns.tolist())) == len(cost)
    np.testing.assert_allclose(
        cost[np.arange(len(cost)), columns].sum(), cost[linear_sum_assignment(cost)].sum(), atol=1e-9
    )


def test_rows_of_which_none_can_have_what_it_likes_best_get_the_least_together() -> None:
    """Wikipedia, Hungarian algorithm, the example of Alice, Bob and Carol: 8 + 4 + 3 = 15."""
    cost = np.array([[8.0, 4.0, 7.0], [5.0, 2.0, 3.0], [9.0, 4.0, 8.0]])
    assert assignment(cost).tolist() == [0, 2, 1]
