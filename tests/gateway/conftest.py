"""What tests of a gateway on a bus share."""

from collections.abc import Iterator

import pytest
import zenoh
from system.processes import free_ports

from noctule import bus


@pytest.fixture
def router() -> Iterator[zenoh.Session]:
    (port,) = free_ports(1)
    with bus.open_session(listen=[f"tcp/127.0.0.1:{port}"]) as session:
        yield session
