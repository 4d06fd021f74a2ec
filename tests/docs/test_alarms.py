"""The page of alarms has an entry for each sentence of the files that raise alarms, and no entry that is old."""

import re

from docs.alarm_texts import sentences
from system.processes import ROOT

from noctule.faults import word
from noctule_gateway.health.vocabulary import FAULTS

PAGE = ROOT / "deploy/docs/pages/alarms.md"
NO_ALARMS = {
    # Parts of "its log was damaged".
    ", the last is sweep ...",
    "... of its sweeps are lost",
    "none of its sweeps is lost",
    # Of a unit that is away: who has seen it last.
    "; ... has read its log to ...",
    # Of a command: noctule-mapper repair.
    "... holds nothing of unit ...",
}
ENTRIES = re.findall(r"^\| `([^`]+)` \|", PAGE.read_text(), re.MULTILINE)


def covers(entry: str, sentence: str) -> bool:
    """The words of ``entry`` stand in ``sentence``, in their order; ``...`` in either is anything."""
    return re.search(".*".join(re.escape(part) for part in entry.split("...")), sentence) is not None


def test_each_alarm_of_the_code_has_an_entry() -> None:
    found = sentences()
    assert len(found) > 50
    lacking = [
        f"{file}: {sentence}"
        for sentence, file in found.items()
        if sentence not in NO_ALARMS and not any(covers(entry, sentence) for entry in ENTRIES)
    ]
    assert not lacking, f"say in {PAGE.name} what these mean:\n" + "\n".join(lacking)


def test_each_entry_is_an_alarm_of_the_code() -> None:
    found = sentences(least_words=1)
    old = [entry for entry in ENTRIES if not any(covers(entry, sentence) for sentence in found)]
    assert not old, "nothing says these any more:\n" + "\n".join(old)
    assert found.keys() >= NO_ALARMS


def test_each_fault_that_sweeps_can_show_is_in_the_table_of_faults() -> None:
    of_the_table = re.findall(r"^\| `[^`]+` \| ([a-z ]+) \| [^|]+ \|$", PAGE.read_text(), re.MULTILINE)
    assert {word(kind) for kind in FAULTS} <= set(of_the_table)
