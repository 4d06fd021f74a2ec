"""The command's work: experiments, figures, report and recording into a folder."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from noctule.progress import Progress
from noctule_mapper.export.atomic_write import write_whole
from noctule_reproduction.experiments import Experiments, experiments
from noctule_reproduction.markdown_report import report
from noctule_reproduction.pictures import pictures
from noctule_reproduction.recording import record

REPORT, RECORDING = "report.md", "survey.rrd"


def reproduce_into(out: Path, seeds: Sequence[int], jobs: int = 1, progress: Progress | None = None) -> Experiments:
    """Write the report, its figures and the recording into the folder ``out``, which is made if need be, from
    consecutive ``seeds``, at least two; returns what they show. Raises OSError where they can't be written.
    """
    out.mkdir(parents=True, exist_ok=True)
    progress = progress or Progress()
    results = experiments(seeds, jobs, progress)
    progress.at("drawing")
    drawn = pictures(results)
    text = report(results, drawn, RECORDING)
    images = {one.name: one.png for one in drawn}
    with TemporaryDirectory(dir=out, prefix=".") as folder:
        recording = Path(folder, RECORDING)
        record(recording, f"reproduce-{seeds[0]}", results.survey.sweeps, images, text)
        files = {f"{name}.png": png for name, png in images.items()}
        files |= {REPORT: text.encode(), RECORDING: recording.read_bytes()}
        write_whole({out / name: content for name, content in files.items()})
    return results
