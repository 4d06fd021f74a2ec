"""The site file and the fleet file."""

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

from noctule import site as sites
from noctule.doctor.finding import Finding, Level
from noctule.errors import SiteFileError
from noctule.site import Site

_EXPIRES_SOON = 3  # exit status of noctule-deploy check
_LONGEST_S = 60


def check_site(file: Path) -> tuple[Site | None, list[Finding]]:
    """The site, or None where the file can't be used, with a finding for each mistake."""
    try:
        site = sites.load(file)
    except SiteFileError as error:
        return None, [Finding(Level.FAULT, "site file", line) for line in str(error).splitlines()]
    units = f"{len(site.units)} unit{'' if len(site.units) == 1 else 's'}"
    return site, [Finding(Level.OK, "site file", f"{file}: site {site.name!r} with {units}")]


def check_fleet(file: Path) -> Iterator[Finding]:
    """What noctule-deploy, which knows fleets, finds in the fleet file and the folders rendered beside it."""
    program = shutil.which("noctule-deploy")
    if program is None:
        yield Finding(Level.WARNING, "fleet file", "noctule-deploy is not installed here: check it where it is")
        return
    command = [program, "check", str(file), "--out", str(file.parent / "rendered")]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=_LONGEST_S, check=False)
    level = {0: Level.OK, _EXPIRES_SOON: Level.WARNING}.get(ended.returncode, Level.FAULT)
    for line in (ended.stdout + ended.stderr).splitlines():
        yield Finding(level, "fleet file", line)
