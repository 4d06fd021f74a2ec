"""The first map after an installation waits for a compiler, and the log says so."""

import logging

import numba
import pytest

from noctule_mapper.grid import compiling


def test_the_first_compilation_is_logged_and_no_other(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, compiling.__name__)
    compiling.announce()
    assert not caplog.messages
    for add in (lambda x: x + 1, lambda x: x + 2):
        assert numba.njit(add)(1) in (2, 3)
    assert caplog.messages == ["compiling the grid's functions, once after an installation: some 12 s of computing"]
