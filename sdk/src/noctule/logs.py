"""How a service writes its log to standard error: as text for people, or as a JSON object a line for a collector."""

import json
import logging
import sys
from datetime import UTC, datetime
from enum import StrEnum

from noctule.plain_text import plain

FORMAT_VARIABLE = "NOCTULE_LOG_FORMAT"


class LogFormat(StrEnum):
    """The two ways to write a log."""

    TEXT = "text"
    JSON = "json"


class JsonFormatter(logging.Formatter):
    """One line a record: time (UTC, RFC 3339), level, logger, message, and exception where there is one.

    Nothing else is written, so what a library hangs on its records stays out of the log.
    """

    def __init__(self, prefix: str = "") -> None:
        super().__init__()
        self._prefix = prefix

    def format(self, record: logging.LogRecord) -> str:
        """The record as a line of ASCII."""
        utc = datetime.fromtimestamp(record.created, UTC).replace(tzinfo=None)
        line = {
            "time": f"{utc.isoformat(timespec='microseconds')}Z",
            "level": record.levelname,
            "logger": record.name,
            "message": self._prefix + record.getMessage(),
        }
        if record.exc_info and record.exc_info[1] is not None:
            line["exception"] = self.formatException(record.exc_info)
        return json.dumps(line)


class TextFormatter(logging.Formatter):
    """Text for people. A message is one line: it may hold what a stranger has put on the bus."""

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802
        """The record as text, without its traceback."""
        record.message = plain(record.message)
        return super().formatMessage(record)


class StderrHandler(logging.StreamHandler):
    """Writes to what ``sys.stderr`` is when something is logged: a progress line there makes room for it."""

    def emit(self, record: logging.LogRecord) -> None:
        """Write one record."""
        self.setStream(sys.stderr)
        super().emit(record)


def set_up(log_format: LogFormat, prefix: str = "") -> None:
    """Write the log of this process from INFO on, with Python's warnings. Call it once, when the program starts.

    Every message begins with ``prefix``, a name that tells apart processes that write to one place.
    """
    handler = logging.StreamHandler()
    text = f"%(asctime)s %(levelname)s %(name)s: {prefix}%(message)s"
    handler.setFormatter(JsonFormatter(prefix) if log_format is LogFormat.JSON else TextFormatter(text))
    logging.basicConfig(level=logging.INFO, handlers=[handler])
    logging.captureWarnings(True)


def log_lines(log: logging.Logger, error: Exception) -> None:
    """Log what ends a program, each line of it as a message of its own: a site file has a line for each mistake."""
    for line in str(error).splitlines():
        log.error("%s", line)
