"""What holds for every test."""

import gc
import os
import signal
from collections.abc import Iterator
from typing import Any

import pytest
import zenoh
from hypothesis import HealthCheck, settings
from system.processes import free_ports

from noctule import bus
from noctule.ending import CLOSE_VARIABLE

# Folders of tests that run real programs, many cuts of power or many rooms. They begin first, and the short ones fill
# the gaps; long tests of the mapper use both processors, so the others do not wait for them at the end.
LONG = ("system", "viewer", "docs", "reproduction", "firmware", "mapper")

# The machines are noisy: how long an example takes, or takes to be drawn, tells nothing. CI judges a change by the same
# examples each time (as hypothesis's own profile for it does); everybody else draws new ones at each run.
settings.register_profile(
    "noisy machine",
    deadline=None,
    derandomize=bool(os.environ.get("CI")),
    max_examples=50,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("noisy machine")


# A shell that runs the tests in the background has them ignore Ctrl-C, and so would the programs that they start.
signal.signal(signal.SIGINT, signal.default_int_handler)

# A service among five tests' programs may be starved while it closes; those tests that time it say so (AS_PROMISED).
os.environ[CLOSE_VARIABLE] = "60"


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """The tests of the long folders before the others; Makefile has pytest-xdist keep that order."""
    tests = config.rootpath / "tests"

    def place(item: pytest.Item) -> int:
        folder = item.path.relative_to(tests).parts[0]
        return LONG.index(folder) if folder in LONG else len(LONG)

    items.sort(key=place)


def pytest_collection_finish() -> None:
    """The modules and tests stay until the process ends, so the collector of garbage need not look through them."""
    gc.freeze()


@pytest.fixture(scope="module", autouse=True)
def no_session_is_left_open() -> Iterator[None]:
    """A session that a test leaves open has threads for as long as its worker lives, and a fork of it may hang."""
    opened: list[tuple[str, zenoh.Session]] = []
    open_one = zenoh.open

    def noted(*arguments: Any, **named: Any) -> zenoh.Session:
        session = open_one(*arguments, **named)
        opened.append((os.environ.get("PYTEST_CURRENT_TEST", ""), session))
        return session

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(zenoh, "open", noted)
        yield
    left = {test for test, session in opened if not session.is_closed()}
    if opened:  # a closed one in a cycle of references is collected here, and not in a fork
        opened.clear()
        gc.collect()
    assert not left, f"left a Zenoh session open: {left}"


@pytest.fixture
def sessions() -> Iterator[tuple[zenoh.Session, zenoh.Session]]:
    """A router and a client of it."""
    (port,) = free_ports(1)
    with (
        bus.open_session(listen=[f"tcp/127.0.0.1:{port}"]) as one,
        bus.open_session(connect=[f"tcp/127.0.0.1:{port}"]) as other,
    ):
        yield one, other
