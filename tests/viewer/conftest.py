"""What several of the viewer's tests begin with."""

import pytest
from viewer.heard_site import Site


@pytest.fixture
def site() -> Site:
    return Site()
