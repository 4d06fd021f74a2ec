"""Which operators' certificates a gateway takes commands from: the file ``operators.json`` beside its certificate.

``noctule-deploy render`` writes it into the folders of gateways and routers. It has no certificate that was revoked,
and none of an operator who is not for the gateway's site. The routers go by the same list, but they only see who passes
a command on; who has signed it, only the gateway sees.
"""

import json
import logging
from collections.abc import Iterable
from pathlib import Path

from noctule.errors import TlsError

FILE = "operators.json"

_COPY = "run noctule-deploy render and copy the folder here again"

_log = logging.getLogger(__name__)


def to_json(common_names: Iterable[str]) -> str:
    """The list as it stands in the file."""
    return json.dumps(sorted(common_names), indent=1) + "\n"


class Operators:
    """The list in a ``folder``, read again when the file has changed. Without a file every operator is admitted.

    ``detail`` says what is wrong with the file; it is empty if nothing is. Raises TlsError: the file can't be used.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / FILE
        self._seen = _version(self._path)
        self._admitted = None if self._seen is None else _read(self._path)
        self.detail = "" if self._seen else f"revoked operators are not refused: {self._path} is not there; {_COPY}"
        if self.detail:
            _log.warning("%s", self.detail)

    def admit(self, common_name: str) -> bool:
        """Whether commands may be signed with the certificate of that name. From any thread, without reading a file."""
        return self._admitted is None or common_name in self._admitted

    def look(self) -> None:
        """Take in a file that has changed. Where it can't be used, the list before stays in force."""
        version = _version(self._path)
        if version == self._seen:
            return
        try:
            self._admitted = _read(self._path)
        except TlsError as error:  # it is tried again: rights may change, and a disk may recover
            if (detail := f"{error}; the list before stays in force") != self.detail:
                self.detail = detail
                _log.error("%s", detail)
        else:
            self._seen, self.detail = version, ""
            _log.info("operators who may command: %s", ", ".join(sorted(self._admitted)) or "none")


def _version(path: Path) -> tuple[int, int, int] | None:
    """What differs once the file has been written again; None where there is none."""
    try:
        stat = path.stat()
    except OSError:
        return None
    return stat.st_ino, stat.st_mtime_ns, stat.st_size


def _read(path: Path) -> frozenset[str]:
    try:
        names = json.loads(path.read_text())
    except (OSError, ValueError, RecursionError) as error:
        raise TlsError(f"{path} can't be read ({error}): {_COPY}") from error
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise TlsError(f"{path} is no list of operators' certificates: {_COPY}")
    return frozenset(names)
