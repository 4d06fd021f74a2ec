"""The first map after an installation waits for a compiler, and the log says so."""

import subprocess
import sys

TWO_COMPILED = """
import logging
import numba
from noctule_mapper.grid import compiling

logging.basicConfig(format="%(message)s", level=logging.INFO)
compiling.announce()
logging.info("announced")
for add in (lambda x: x + 1, lambda x: x + 2):
    assert numba.njit(add)(1) in (2, 3)
"""


def test_the_first_compilation_is_logged_and_no_other() -> None:
    """In a process of its own: importing the grid announces too."""
    told = subprocess.run([sys.executable, "-c", TWO_COMPILED], capture_output=True, text=True, check=True).stderr
    compiling = "compiling the grid's functions, once after an installation: some 12 s of computing"
    assert told.splitlines() == ["announced", compiling]
