"""The log as JSON lines, as a collector reads them."""

import json
import logging
import subprocess
import sys
from datetime import UTC, datetime

from noctule.logs import JsonFormatter, TextFormatter


def line(message: str, *arguments: object, **extra: object) -> dict[str, str]:
    record = logging.getLogger("noctule.door").makeRecord(
        "noctule.door", logging.WARNING, "door.py", 1, message, arguments, None, extra=extra
    )
    record.created = datetime(2026, 3, 4, 5, 6, 7, 890123, UTC).timestamp()
    written = JsonFormatter().format(record)
    assert "\n" not in written and written.isascii()
    return json.loads(written)


def test_a_line_has_time_in_utc_level_logger_and_message_and_nothing_else() -> None:
    assert line("%s: %d °C\nhot", "u7", 21, password="secret") == {
        "time": "2026-03-04T05:06:07.890123Z",
        "level": "WARNING",
        "logger": "noctule.door",
        "message": "u7: 21 °C\nhot",
    }


def test_a_time_on_the_full_second_has_its_digits_too() -> None:
    record = logging.makeLogRecord({"msg": "", "created": 0.0})
    assert json.loads(JsonFormatter().format(record))["time"] == "1970-01-01T00:00:00.000000Z"


def test_exceptions_and_warnings_of_a_program_are_lines_of_json_too() -> None:
    program = """
import logging, warnings
from noctule.logs import LogFormat, set_up
set_up(LogFormat("json"))
try:
    raise ValueError("the door\\nis open")
except ValueError:
    logging.getLogger("door").exception("failed")
warnings.warn("old")
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=120)
    failed, warned = [json.loads(each) for each in done.stderr.splitlines()]
    assert failed["message"] == "failed" and failed["exception"].endswith("ValueError: the door\nis open")
    assert warned["level"] == "WARNING" and "UserWarning: old" in warned["message"]


def test_a_message_of_a_text_log_is_one_line_that_no_terminal_obeys() -> None:
    record = logging.makeLogRecord({"msg": "unit %s: °C", "args": ("\x1b[2Ju1\nERROR all is lost",)})
    assert TextFormatter("%(message)s").format(record) == "unit \\x1b[2Ju1\\nERROR all is lost: °C"
