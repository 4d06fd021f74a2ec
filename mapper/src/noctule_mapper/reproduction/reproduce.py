"""The command's work: experiments, figures, report and recording into a folder."""

from collections.abc import Sequence
from pathlib import Path

from noctule_mapper.reproduction.experiments import Experiments, experiments
from noctule_mapper.reproduction.markdown_report import report
from noctule_mapper.reproduction.pictures import pictures
from noctule_mapper.reproduction.recording import record
from noctule_mapper.whole_file import write_whole

REPORT, RECORDING = "report.md", "survey.rrd"


def reproduce_into(out: Path, seeds: Sequence[int], jobs: int = 1) -> Experiments:
    """Write the report, its figures and the recording into the folder ``out``, which is made if need be, from
    consecutive ``seeds``, at least two; returns what they show. Raises OSError where they can't be written.
    """
    out.mkdir(parents=True, exist_ok=True)
    results = experiments(seeds, jobs)
    drawn = pictures(results)
    text = report(results, drawn, RECORDING)
    write_whole({out / f"{one.name}.png": one.png for one in drawn} | {out / REPORT: text.encode()})
    record(out / RECORDING, f"reproduce-{seeds[0]}", results.survey.sweeps, {one.name: one.png for one in drawn}, text)
    return results
