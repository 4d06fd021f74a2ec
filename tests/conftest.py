"""What holds for every test."""

import pytest
from hypothesis import HealthCheck, settings

# Folders of tests that run real programs or map many rooms. They begin first, and the short ones fill the gaps.
LONG = ("system", "viewer", "reproduction", "mapper")

# The machines are noisy: how long an example takes, or takes to be drawn, tells nothing.
settings.register_profile("noisy machine", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("noisy machine")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """The tests of the long folders before the others; Makefile has pytest-xdist keep that order."""
    tests = config.rootpath / "tests"

    def place(item: pytest.Item) -> int:
        folder = item.path.relative_to(tests).parts[0]
        return LONG.index(folder) if folder in LONG else len(LONG)

    items.sort(key=place)
