"""The sentences that the code can raise an alarm with, read from its source."""

import ast
import re
from collections.abc import Iterator

from system.processes import ROOT

RAISED_IN = (
    "gateway/src/noctule_gateway/status/*.py",
    "gateway/src/noctule_gateway/health/bearings_off.py",
    "gateway/src/noctule_gateway/health/blocked.py",
    "gateway/src/noctule_gateway/health/clock_slips.py",
    "gateway/src/noctule_gateway/health/dead_bearing.py",
    "gateway/src/noctule_gateway/health/shift.py",
    "gateway/src/noctule_gateway/health/one_value.py",
    "gateway/src/noctule_gateway/health/pose_watch.py",
    "gateway/src/noctule_gateway/health/sensor_line.py",
    "gateway/src/noctule_gateway/health/silence.py",
    "gateway/src/noctule_gateway/link/peer.py",
    "gateway/src/noctule_gateway/log/faults.py",
    "gateway/src/noctule_gateway/log/log_file.py::damage",
    "gateway/src/noctule_gateway/log/log_file.py::_refuse_another_units",
    "gateway/src/noctule_gateway/clock/clock_watch.py",
    "gateway/src/noctule_gateway/service.py",
    "gateway/src/noctule_gateway/unit/step_check.py",
    "gateway/src/noctule_gateway/bus/log_readers.py::cut_off",
    "gateway/src/noctule_gateway/bus/unit_on_bus.py::report",
    "gateway/src/noctule_gateway/audit/audit_log.py",
    "gateway/src/noctule_gateway/turns/keeper.py::trouble",
    "mapper/src/noctule_mapper/contour/reasons.py::no_room",
    "mapper/src/noctule_mapper/live/intake.py",
    "mapper/src/noctule_mapper/live/map_worker.py",
    "mapper/src/noctule_mapper/live/publish.py",
    "mapper/src/noctule_mapper/live/refused.py",
    "mapper/src/noctule_mapper/live/remote_map.py",
    "mapper/src/noctule_mapper/live/service.py",
    "mapper/src/noctule_mapper/live/store.py",
    "mapper/src/noctule_mapper/readings/faulty.py",
    "mapper/src/noctule_mapper/readings/sweep.py",
    "mapper/src/noctule_mapper/sharing/offers.py::let_in",
    "mapper/src/noctule_mapper/sharing/unshared.py",
    "sdk/src/noctule/bus_config.py::open_to_all",
    "sdk/src/noctule/bus_watch.py",
    "sdk/src/noctule/endpoint_watch.py",
    "sdk/src/noctule/faults.py::word",
    "sdk/src/noctule/kernel_clock.py::fault",
    "sdk/src/noctule/tls.py::expiry_alarm",
    "sdk/src/noctule/unit_list.py",
    "viewer/src/noctule_viewer/board/documents.py::_no_mapper",
    "viewer/src/noctule_viewer/board/site_state.py::__init__",
    "viewer/src/noctule_viewer/board/unit_health.py",
    "viewer/src/noctule_viewer/presence.py",
    "viewer/src/noctule_viewer/recordings/recorder.py::_lack_of_space",
    "viewer/src/noctule_viewer/recordings/recorder.py::_record_one_file",
    "viewer/src/noctule_viewer/recordings/recorder.py::_run",
    "viewer/src/noctule_viewer/relay.py::_status",
    "viewer/src/noctule_viewer/rerun_versions.py::elsewhere",
    "viewer/src/noctule_viewer/rerun_versions.py::trouble",
)
"""Files, or one function of a file."""

_LOGGED = {
    "debug",
    "info",
    "warning",
    "error",
    "exception",
    "log",
    "show_event",
    "end",
}  # lines of a log, and good news
_SQL = re.compile(r"\s*(SELECT|DELETE|INSERT|UPDATE|PRAGMA)\b")


def sentences(least_words: int = 4) -> dict[str, str]:
    """Each sentence with ``...`` for what it puts in, and where it stands."""
    found: dict[str, str] = {}
    for place in RAISED_IN:
        pattern, _, function = place.partition("::")
        files = sorted(ROOT.glob(pattern))
        assert files, f"no file {pattern}: alarm_texts.py names one that is gone"
        for file in files:
            for node in _bodies(ast.parse(file.read_text()), function):
                found |= {text: str(file.relative_to(ROOT)) for text in _texts(node) if _is_sentence(text, least_words)}
    return found


def _bodies(module: ast.Module, function: str) -> list[ast.AST]:
    if not function:
        return [module]
    named = [node for node in ast.walk(module) if isinstance(node, ast.FunctionDef) and node.name == function]
    assert named, f"no function {function}: alarm_texts.py names one that is gone"
    return list(named)


def _is_sentence(text: str, least_words: int) -> bool:
    spoken = re.sub(r"\S*_\S*", "", text)  # names of counters are no words
    return len(re.findall(r"[A-Za-z']{2,}", spoken)) >= least_words and not _SQL.match(text)


def _texts(node: ast.AST) -> Iterator[str]:
    if isinstance(node, ast.JoinedStr):
        yield "".join(str(part.value) if isinstance(part, ast.Constant) else "..." for part in node.values)
        return
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
        return
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        return  # a docstring
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in _LOGGED:
        return
    for child in ast.iter_child_nodes(node):
        yield from _texts(child)
