"""noctule-mapper as people type it, run in this process."""

import contextlib
import io
from dataclasses import dataclass

import pytest

from noctule_mapper.cli import main


@dataclass(frozen=True)
class Result:
    """What a command left: its exit status and all that it printed."""

    exit_code: int
    output: str
    complaint: str  # on standard error


def noctule_mapper(*arguments: object) -> Result:
    """Run ``noctule-mapper`` with ``arguments``."""
    output, errors = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(errors), pytest.raises(SystemExit) as ended:
        main([str(one) for one in arguments])
    if isinstance(ended.value.code, str):  # as the interpreter does with it
        return Result(1, output.getvalue(), errors.getvalue() + ended.value.code + "\n")
    return Result(ended.value.code or 0, output.getvalue(), errors.getvalue())
