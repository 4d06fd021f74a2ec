"""How long a command takes to begin, against what any program with NumPy takes: bytecode is cached."""

import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from statistics import median

from mapper.live_site import paper_survey

from noctule import survey

_ROUNDS = 10
_HELP_LIMIT, _FIT_LIMIT = 2.5, 6.0  # requirements
_NUMPY = (sys.executable, "-c", "import numpy")


def rows() -> list[tuple[str, float]]:
    """What was started, and its processor time against that of ``import numpy`` between the same rounds."""
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder, "survey.jsonl")
        with source.open("w") as stream:
            survey.write(paper_survey(), stream)
        room = ("noctule-mapper", "fit", str(source))
        programs = ("noctule-mapper", "noctule", "noctule-gateway", "noctule-viewer", "noctule-deploy")
        return [
            *(
                (f"{each} --help, against import numpy; {_HELP_LIMIT:g} at most", _against_numpy((each, "--help")))
                for each in programs
            ),
            (
                f"noctule-mapper fit of the paper's room, against import numpy; {_FIT_LIMIT:g} at most",
                _against_numpy((*room, "--contour", f"{folder}/contour.json")),
            ),
        ]


def _against_numpy(command: Sequence[str]) -> float:
    _cpu_s(command)  # the first run may write its bytecode
    return median(_cpu_s(command) / _cpu_s(_NUMPY) for _ in range(_ROUNDS))


def _cpu_s(command: Sequence[str]) -> float:
    """Processor time of one run."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=environment)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
