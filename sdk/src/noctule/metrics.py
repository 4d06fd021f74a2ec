"""A service's statuses as Prometheus metrics. Nothing is counted here: each scrape reads the present statuses."""

import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping

from google.protobuf.timestamp_pb2 import Timestamp
from prometheus_client import CollectorRegistry, ProcessCollector
from prometheus_client.core import Metric
from prometheus_client.registry import Collector

from noctule.messages_pb2 import Contour, FaultKind, ServiceStatus, UnitStatus

Statuses = Callable[[], Iterable[UnitStatus | ServiceStatus | Contour]]
Labels = Mapping[str, str]

# A status calls all its numbers counters. These rise and fall, as does what is a size or a duration.
_LEVELS = frozenset(
    {
        "members",
        "sites",
        "sites_mapped",
        "sites_unshared",
        "units",
        "units_connected",
        "units_late",
        "sweeps_waiting",
        "unit_sweeps_waiting",
        "unit_ring_used_bytes",
        "clock_unsynchronised",
    }
)
_LEVEL_ENDINGS = ("_ms", "_bytes")


class StatusCollector(Collector):
    """The metrics of what ``statuses`` gives at that moment; it must not wait for anything.

    A counter ``name`` of a unit's status is ``noctule_name_total``, one of a service's ``noctule_ROLE_name_total``.
    What ends in ``_ms`` is in seconds.
    """

    def __init__(self, statuses: Statuses, now_s: Callable[[], float] = time.time) -> None:
        self._statuses, self._now_s = statuses, now_s

    def collect(self) -> Iterator[Metric]:
        """A family of samples for each name."""
        families = _Families(self._now_s())
        for status in self._statuses():
            match status:
                case UnitStatus():
                    _add_unit(families, status)
                case ServiceStatus():
                    _add_service(families, status)
                case Contour():
                    _add_contour(families, status)
        return families.all()


def registry(
    statuses: Statuses,
    child: Callable[[], int] | None = None,
    sites: Callable[[], Mapping[str, int]] | None = None,
) -> CollectorRegistry:
    """What a service shows: its statuses, and CPU, memory and open files of its process.

    The same of the process that ``child`` names, as ``noctule_child_process_...``, and of those that ``sites`` names,
    each with its site as a label, as ``noctule_site_process_...``.
    """
    result = CollectorRegistry()
    result.register(StatusCollector(statuses))
    ProcessCollector(pid=os.getpid, registry=result)
    if child is not None:
        ProcessCollector(namespace="noctule_child", pid=child, registry=result)
    if sites is not None:
        result.register(_SiteProcesses(sites))
    return result


class _SiteProcesses(Collector):
    """What ProcessCollector has of one process, of several."""

    def __init__(self, pids: Callable[[], Mapping[str, int]]) -> None:
        self._pids = pids

    def collect(self) -> Iterator[Metric]:
        families: dict[str, Metric] = {}
        for site, pid in self._pids().items():
            for found in ProcessCollector(namespace="noctule_site", pid=lambda pid=pid: pid, registry=None).collect():
                family = families.setdefault(found.name, Metric(found.name, found.documentation, found.type))
                for sample in found.samples:
                    family.add_sample(sample.name, {**sample.labels, "site": site}, sample.value)
        return iter(families.values())


class _Families:
    """Metrics as they gather, by name."""

    def __init__(self, now_s: float) -> None:
        self._now_s = now_s
        self._by_name: dict[str, Metric] = {}

    def all(self) -> Iterator[Metric]:
        return iter(self._by_name.values())

    def gauge(self, name: str, text: str, value: float, labels: Labels) -> None:
        self._family(name, text, "gauge").add_sample(name, dict(labels), value)

    def counter(self, name: str, text: str, value: float, labels: Labels) -> None:
        self._family(name, text, "counter").add_sample(f"{name}_total", dict(labels), value)

    def age(self, name: str, text: str, since: Timestamp, labels: Labels) -> None:
        self.gauge(name, text, self._now_s - since.ToNanoseconds() * 1e-9, labels)

    def counters(self, prefix: str, counters: Mapping[str, int], labels: Labels) -> None:
        """The counters of a status, each under the name that it has there."""
        for name, value in sorted((_word(name), value) for name, value in counters.items()):
            text = f"Counter {name} of the status"
            if name.endswith("_ms"):
                self.gauge(f"{prefix}_{name.removesuffix('_ms')}_seconds", text, value / 1000, labels)
            elif name in _LEVELS or name.endswith(_LEVEL_ENDINGS):
                self.gauge(f"{prefix}_{name}", text, value, labels)
            else:
                self.counter(f"{prefix}_{name}", text, value, labels)

    def _family(self, name: str, text: str, kind: str) -> Metric:
        return self._by_name.setdefault(name, Metric(name, text, kind))


def _add_unit(families: _Families, status: UnitStatus) -> None:
    labels = {"site": status.site, "unit": status.unit, "service": status.gateway}
    # protobuf gives the names of an enum as STATE_IDLE; the label's value is idle.
    for name, number in UnitStatus.State.items():
        state = labels | {"state": name.removeprefix("STATE_").lower()}
        families.gauge("noctule_unit_state", "1 for the state that the unit is in", status.state == number, state)
    families.gauge("noctule_unit_trouble", "1 while the status names a trouble", bool(status.detail), labels)
    standing = {fault.kind for fault in status.faults}
    for name, number in FaultKind.items()[1:]:
        fault = labels | {"fault": name.removeprefix("FAULT_KIND_").lower()}
        families.gauge("noctule_unit_fault", "1 while its sweeps show the fault", number in standing, fault)
    families.age("noctule_unit_status_age_seconds", "Since the status was made", status.time, labels)
    families.gauge("noctule_unit_firmware_info", "The unit's firmware", 1, labels | {"version": status.firmware})
    families.gauge(
        "noctule_clock_error_seconds", "Standard deviation of the unit's clock", status.clock_error_s, labels
    )
    families.gauge("noctule_clock_drift_ratio", "Unit's clock against the host's", status.clock_drift, labels)
    families.gauge("noctule_log_head", "Last log_sequence committed", status.log_head, labels)
    families.gauge("noctule_log_tail", "First log_sequence still held", status.log_tail, labels)
    families.counter("noctule_log_removed", "Sweeps removed by size or age", status.log_removed, labels)
    families.counter("noctule_log_damaged", "Sweeps lost by damage to the log's file", status.log_damaged, labels)
    if status.HasField("chip_temperature_c"):
        families.gauge("noctule_unit_chip_temperature_celsius", "Of the unit's chip", status.chip_temperature_c, labels)
    families.counters("noctule", status.counters, labels)


def _add_service(families: _Families, status: ServiceStatus) -> None:
    labels = {"site": status.site, "service": status.name}
    info = labels | {"role": status.role, "version": status.version}
    families.gauge("noctule_build_info", "The service's version", 1, info)
    families.age("noctule_service_status_age_seconds", "Since the status was made", status.time, labels)
    families.counters(f"noctule_{_word(status.role)}", status.counters, labels)


def _add_contour(families: _Families, contour: Contour) -> None:
    labels = {"site": contour.site, "service": contour.mapper}
    families.age("noctule_contour_age_seconds", "Since the newest sweep of the contour", contour.time, labels)
    families.gauge("noctule_contour_version", "Counts the mapper's contours", contour.version, labels)
    families.gauge("noctule_contour_sweeps", "Sweeps that the contour rests on", contour.sweeps, labels)
    for kind, found in (("wall", contour.walls), ("corner", contour.corners), ("cylinder", contour.cylinders)):
        families.gauge("noctule_contour_objects", "Objects of the contour", len(found), labels | {"kind": kind})


def _word(text: str) -> str:
    """``text`` as a part of a metric's name."""
    return "".join(each if each.isascii() and each.isalnum() else "_" for each in text)
