"""The board's documents, as Markdown: alarms on top, the table of units, and a sheet for each unit."""

from collections.abc import Callable, Mapping, Sequence
from itertools import zip_longest

from noctule.ages import age, duration
from noctule.messages_pb2 import Contour, ServiceStatus
from noctule_viewer.board.site_state import Heard
from noctule_viewer.board.unit_health import MOST_UNITS, Health, UnitHealth
from noctule_viewer.board.words import counted, hour, listed

_SERVICE_SILENT_AFTER_S = 5.0  # statuses come each second
_SIGN = "\u26a0"
_LONGEST_WORDS = 90
_HEADING = (
    100  # letters of one line beside site and hour, on a page of 1280 pixels: below it there is room for one more
)
_MOST_GROUPS = 5  # of units with the same trouble
_SHORT_WORDS = 30
_LONGEST_TROUBLE = 600  # of one unit, on its own sheet
_WORST_FIRST = [Health.AWAY, Health.ATTENTION, Health.WELL]
# What a unit does says nothing of its trouble.
_AT_WORK = ("idle", "sweeping", "homing", "paused", "turning", "measuring")


def alarms(site: str, units: Sequence[UnitHealth], heard: Heard, elsewhere: Sequence[str] = ()) -> str:
    """What is wrong, the worst in the heading, or that all is well; the worst of what is wrong ``elsewhere``, at sites
    that have other tabs; and the time of this machine.
    """
    now = hour(heard.now_s, heard.now_s)
    troubles = _troubles(units, heard)
    told = f"{_SIGN} {site} — {troubles[0]}" if troubles else f"{site} — all is well"
    heading = f"### {told} — {now} UTC"
    others = [_line(f"{_SIGN} Other sites: {'; '.join(elsewhere)}")] if elsewhere else []
    rest = [f"**{each}**" for each in (*others, *troubles[1:])]
    return "\n\n".join([heading, *rest, "; ".join([_map(heard), counted(len(units), "unit"), *_lacking(heard)])])


def worst(site: str, units: Sequence[UnitHealth], heard: Heard) -> str:
    """The worst trouble of ``site``, with its name; empty where all is well."""
    troubles = _troubles(units, heard)
    return f"{site} — {troubles[0]}" if troubles else ""


def table(units: Sequence[UnitHealth], now_s: float) -> str:
    """Those that are not well, each with what is wrong in a line of its own, because a view breaks lines but cuts the
    cells of tables off; then a row for each of the others.
    """
    if not units:
        return "No unit has been heard of yet."
    worst_first = sorted(units, key=lambda unit: _WORST_FIRST.index(unit.health))
    unwell = [_unwell(unit, now_s) for unit in worst_first if unit.health is not Health.WELL]
    well = [
        f"| {unit.unit} | {_cell(unit.words)} | {_since(unit, now_s)} | {_swept(unit, now_s)} |"
        for unit in units
        if unit.health is Health.WELL
    ]
    head = ["| well | state | since | last sweep |", "| --- | --- | --- | --- |"] if well else []
    more = [f"No more than {MOST_UNITS} units are shown."] if len(units) == MOST_UNITS else []
    return "\n\n".join("\n".join(part) for part in (unwell, [*head, *well], more) if part)


def sheet(unit: UnitHealth, now_s: float) -> str:
    """All that is known of one unit: what is wrong with it, and in two columns its figures."""
    well = unit.health is Health.WELL
    heading = f"### {unit.unit} — {unit.health.value}"
    told = [f"{heading}: {_cell(unit.words)}"] if well else [heading, _line(unit.words, _LONGEST_TROUBLE)]
    rows = {"since": _since(unit, now_s), "last sweep": _swept(unit, now_s)}
    if (status := unit.status) is not None:
        rows |= {
            "clock error": f"{1e3 * status.clock_error_s:.2f} ms",
            "clock drift": f"{1e6 * status.clock_drift:.0f} ppm",
            "chip": f"{status.chip_temperature_c:.1f} °C" if status.HasField("chip_temperature_c") else "not known",
            "gateway": f"{status.gateway} {status.gateway_version}",
            "serial number, firmware": f"{status.serial}, {status.firmware or 'not known'}",
            "last start": f"{status.reset_cause or 'not known'}, boot {status.boot}",
            "sweeps in the log": f"{status.log_tail} to {status.log_head}",
        }
        rows |= {name.replace("_", " "): str(value) for name, value in sorted(status.counters.items())}
    return "\n\n".join([*told, _in_two_columns(rows)])


def _troubles(units: Sequence[UnitHealth], heard: Heard) -> list[str]:
    """The worst first: without a bus nothing else is known, and without a mapper the map is old."""
    unwell = [unit for unit in units if unit.health is not Health.WELL]
    troubles = [_line(heard.own_trouble)] if heard.own_trouble else []
    mappers = [status for status in heard.services.values() if status.role == "mapper"]
    troubles += _no_mapper(mappers, heard)
    if unwell:
        need = "needs" if len(unwell) == 1 else "need"
        how_many = f"{len(unwell)} of {counted(len(units), 'unit')} {need} attention"
        whole = f"{how_many}: {_named_units(unwell, lambda unit: unit.words)}"
        # That each of them is named comes before what exactly is wrong, which stands above the table.
        fits = len(whole) <= _HEADING
        troubles.append(_line(whole if fits else f"{how_many}: {_named_units(unwell, _in_short)}"))
    told = [each for each in mappers if each.detail and heard.service_silent_s[each.name] <= _SERVICE_SILENT_AFTER_S]
    return [*troubles, *(_line(f"{_named_mapper(each)}: {each.detail}") for each in told)]


def _unwell(unit: UnitHealth, now_s: float) -> str:
    since = f", since {_since(unit, now_s)}" if unit.since_s is not None else ""
    swept = f", last sweep {_swept(unit, now_s)}" if unit.swept_s is not None else ""
    return f"- **{unit.unit} — {unit.health.value.upper()}**{since}{swept}: {_line(_trouble(unit))}"


def _trouble(unit: UnitHealth) -> str:
    """Without what the unit does meanwhile: of words like ``sweeping: silent: no echo at 61 bearings`` what matters."""
    first, mark, rest = unit.words.partition(": ")
    return rest if mark and first in _AT_WORK else unit.words


def _in_short(unit: UnitHealth) -> str:
    """``away``, ``silent``, ``fault``."""
    if unit.health is Health.AWAY:
        return unit.health.value
    word, *_ = _trouble(unit).split(": ")
    return word if len(word) <= _SHORT_WORDS else word[: _SHORT_WORDS - 3] + "..."


def _named_units(unwell: Sequence[UnitHealth], words_of: Callable[[UnitHealth], str]) -> str:
    """``u1, u2: what is wrong with both / u3: something else / 2 more units``."""
    of_words: dict[str, list[str]] = {}
    for unit in unwell:
        of_words.setdefault(words_of(unit), []).append(unit.unit)
    told = list(of_words.items())[:_MOST_GROUPS]
    more = len(unwell) - sum(len(units) for _, units in told)
    rest = [counted(more, "more unit")] if more else []
    return " / ".join([*(f"{listed(units)}: {words}" for words, units in told), *rest])


def _no_mapper(mappers: Sequence[ServiceStatus], heard: Heard) -> list[str]:
    if not mappers:
        return ["no mapper maps this site"]
    silent_s = min(heard.service_silent_s[status.name] for status in mappers)
    if silent_s > _SERVICE_SILENT_AFTER_S:
        names = " and ".join(sorted(status.name for status in mappers))
        return [f"no mapper is heard ({names} silent for {duration(silent_s)}): the map is old"]
    return []


def _named_mapper(mapper: ServiceStatus) -> str:
    return mapper.name if "mapper" in mapper.name else f"mapper {mapper.name}"


def _map(heard: Heard) -> str:
    contour = heard.contour
    if contour is None:
        return "no contour yet"
    found = ", ".join(counted(count, noun) for noun, count in _objects(contour).items())
    made_s = contour.time.ToNanoseconds() / 1e9
    return f"{found} from {counted(contour.sweeps, 'sweep')}, the last of them {age(heard.now_s - made_s)}"


def _lacking(heard: Heard) -> list[str]:
    """What a map of walls could have more, as its mapper says; of one without it says so as trouble."""
    contour = heard.contour
    return [_line(contour.note)] if contour is not None and contour.walls and contour.note else []


def _objects(contour: Contour) -> dict[str, int]:
    return {"wall": len(contour.walls), "corner": len(contour.corners), "cylinder": len(contour.cylinders)}


def _since(unit: UnitHealth, now_s: float) -> str:
    return hour(unit.since_s, now_s) if unit.since_s is not None else "not known"


def _swept(unit: UnitHealth, now_s: float) -> str:
    return age(now_s - unit.swept_s) if unit.swept_s is not None else "none heard"


def _in_two_columns(rows: Mapping[str, str]) -> str:
    """A table of two pairs a line, read down the left one first; the first line is its head."""
    cells = [f"{name} | {_cell(value)}" for name, value in rows.items()]
    half = (len(cells) + 1) // 2
    pairs = zip_longest(cells[:half], cells[half:], fillvalue=" | ")
    first, *rest = [f"| {left} | {right} |" for left, right in pairs]
    return "\n".join([first, "| --- | --- | --- | --- |", *rest])


def _line(words: str, longest: int = 2 * _LONGEST_WORDS) -> str:
    """Words of others, in one line and not too long."""
    words = " ".join(words.split())
    return words if len(words) <= longest else words[: longest - 3] + "..."


def _cell(words: str) -> str:
    words = " ".join(words.split()).replace("|", "\\|")
    return words if len(words) <= _LONGEST_WORDS else words[: _LONGEST_WORDS - 3] + "..."
