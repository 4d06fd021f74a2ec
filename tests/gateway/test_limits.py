"""Open files: in a process of their own, for a hard limit that is lowered stays low."""

import subprocess
import sys

import pytest

IN_A_PROCESS = """
import resource
from noctule_gateway.limits import allow_files
resource.setrlimit(resource.RLIMIT_NOFILE, (256, {most}))
print(allow_files(50), resource.getrlimit(resource.RLIMIT_NOFILE)[0], sep="|")
"""


@pytest.mark.parametrize(
    ("most", "allowed", "told"), [(1000, 700, ""), (500, 500, "50 units need some 700 open files")]
)
def test_as_many_files_as_the_units_need_are_allowed_or_it_is_told(most: int, allowed: int, told: str) -> None:
    program = IN_A_PROCESS.format(most=most)
    said = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    warning, _, limit = said.partition("|")
    assert int(limit) == allowed
    assert warning.startswith(told) if told else warning == ""
