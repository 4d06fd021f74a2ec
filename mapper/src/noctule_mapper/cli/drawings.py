"""What ``fit`` draws of what it found: an SVG file, a Rerun recording, and the viewer opened on it."""

import errno
import shutil
import subprocess
import sys
from pathlib import Path

from noctule.errors import NoctuleError
from noctule.messages_pb2 import Contour
from noctule_mapper.mapper import Mapper

_VIEWER = "noctule-viewer"


class ViewerMissingError(NoctuleError):
    """The viewer is not installed here."""


def draw(mapper: Mapper, contour: Contour, svg: Path | None, rrd: Path | None, view: bool) -> None:
    """Draw ``contour``, fitted by ``mapper``, into the files that are named, and open the viewer on the recording.

    Raises OSError where a file can't be written, ViewerMissingError where there is no viewer.
    """
    if svg:
        from noctule_mapper.export.atomic_write import write_whole
        from noctule_mapper.export.svg import svg as drawn

        write_whole({svg: drawn(contour, mapper.sweeps())})
    if rrd:
        from noctule_mapper.contour.table import contour_table
        from noctule_mapper.rerun_view.recording import record

        try:
            record(rrd, mapper, contour, f"```\n{contour_table(contour)}\n```\n")
        except RuntimeError as error:  # as Rerun says that the disk is full
            raise OSError(errno.EIO, str(error), str(rrd)) from error
        if view:
            _open(rrd)


def _open(rrd: Path) -> None:
    """Open the viewer, as a command of its own: it is another distribution, which a mapper's host may lack."""
    beside = Path(sys.executable).with_name(_VIEWER)
    command = str(beside) if beside.exists() else shutil.which(_VIEWER)
    if command is None:
        raise ViewerMissingError(
            f"{_VIEWER} is not here: install noctule-viewer, or write --rrd FILE and open it in any Rerun viewer"
        )
    status = subprocess.run([command, "open", str(rrd)], check=False).returncode
    if status:
        raise NoctuleError(f"{_VIEWER} ended with status {status}: the lines above say why")
