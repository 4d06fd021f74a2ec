"""noctule-mapper reproduce: report, figures and recording in a folder, their figures those that the mapper gives."""

import contextlib
import io
import json
import os
import re
import subprocess
import sys
import sysconfig
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import rerun.chunk
from mapper.judge import corner_errors_m
from mapper.live_site import paper_survey
from mapper.room import paper_path, paper_room, survey
from PIL import Image

from noctule import rerun_paths
from noctule.survey import write
from noctule_mapper.choices import Method
from noctule_mapper.cli.reproduce import reproduce
from noctule_mapper.config import MapperConfig
from noctule_mapper.contour.contour import Contour
from noctule_mapper.mapper import Mapper
from noctule_reproduction import paper
from noctule_reproduction.comparison import compare, corner_values, wall_values
from noctule_reproduction.runs import METHODS, run_all

ROOT = Path(__file__).parents[2]
SEEDS = (41, 42)
# The figures of the paper that a computer can make: all but schemes and photographs.
FIGURES = (3, 5, 6, 7, 9, 11, 12, 13, 14, 15, 17, 18)


@dataclass(frozen=True)
class Reproduced:
    folder: Path
    printed: str

    @property
    def report(self) -> str:
        return (self.folder / "report.md").read_text()

    def cells(self, row: str) -> list[str]:
        """What follows the name of a row of a table."""
        line = next(line for line in self.report.splitlines() if line.startswith(f"| {row} |"))
        return [cell.strip().strip("*") for cell in line.split("|")[2:-1]]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Reproduced:
    folder, printed = tmp_path_factory.mktemp("made") / "paper", io.StringIO()
    with contextlib.redirect_stdout(printed):
        reproduce(folder, seeds=len(SEEDS), seed=SEEDS[0], jobs=1)
    return Reproduced(folder, printed.getvalue())


def mapped(seed: int, method: Method) -> Contour:
    mapper = Mapper(MapperConfig(method=method))
    for sweep in survey(paper_room(), paper_path(), np.random.default_rng(seed)):
        mapper.register_sweep(sweep)
    return mapper.contour()


def test_the_folder_holds_the_report_a_picture_for_each_figure_and_the_recording(made: Reproduced) -> None:
    pictures = {f"figure_{number:02d}.png" for number in FIGURES}
    assert {path.name for path in made.folder.iterdir()} == {"report.md", "survey.rrd", *pictures}
    for name in pictures:
        with Image.open(made.folder / name) as image:
            assert min(image.size) > 400
            shades = np.asarray(image.convert("L"))
            assert shades.min() < 80, f"{name} is empty"
            assert (shades == 255).mean() > 0.5, "drawn on white"


def test_every_caption_names_its_seeds_and_tells_simulation_from_rig(made: Reproduced) -> None:
    captions = dict(re.findall(r"^\*\*Fig\. (\d+)\.\*\* (.*)$", made.report, re.MULTILINE))
    assert tuple(map(int, captions)) == FIGURES
    tables = re.findall(r"^\*\*Table (?:I|II|III)\.\*\* (?:.+\n)+", made.report, re.MULTILINE)
    assert len(tables) == 3
    for caption in (*captions.values(), *tables):
        assert "simulated" in caption
        assert "real rig" in caption
        assert re.search(r"seeds? 41", caption)


def test_pictures_and_their_captions_stand_together_in_the_papers_order(made: Reproduced) -> None:
    shown = re.findall(r"^!\[Figure (\d+)\]\((.*)\)\n\n\*\*Fig\. (\d+)\.", made.report, re.MULTILINE)
    assert [(int(number), name, int(caption)) for number, name, caption in shown] == [
        (number, f"figure_{number:02d}.png", number) for number in FIGURES
    ]


def test_the_papers_columns_are_as_printed(made: Reproduced) -> None:
    # Liu et al. 2019, Tables I-III.
    assert made.cells("2 rho (cm)")[:3] == ["-229.996", "-230.929", "-231.426"]
    assert made.cells("A error (cm)")[:3] == ["", "5.305", "4.650"]
    assert made.cells("**average error (cm)**")[:3] == ["", "4.002", "3.251"]
    assert made.cells("F R (cm)")[:3] == ["44.8", "47.8", "46.3"]


@pytest.mark.parametrize(("column", "method"), list(enumerate(METHODS, start=3)))
def test_our_columns_are_what_the_mapper_gives_for_the_seeds(made: Reproduced, column: int, method: Method) -> None:
    contours = [mapped(seed, method) for seed in SEEDS]
    errors_cm = np.array([100 * corner_errors_m(contour, paper_room()).mean() for contour in contours])
    assert made.cells("**average error (cm)**")[column] == f"{errors_cm.mean():.2f} ± {errors_cm.std(ddof=1):.2f}"
    radii_cm = np.array([100 * contour.cylinders[0].radius_m for contour in contours])
    assert made.cells("F R (cm)")[column] == f"{radii_cm.mean():.2f} ± {radii_cm.std(ddof=1):.2f}"
    assert f"{method:8} corners {errors_cm.mean():.2f} ± {errors_cm.std(ddof=1):.2f} cm" in made.printed


def test_the_true_columns_are_the_simulated_room(made: Reproduced) -> None:
    corners = np.array([[float(made.cells(f"{letter} {axis} (cm)")[0]) for axis in "xy"] for letter in "ABCDE"])
    assert np.hypot(*(corners[:, None] / 100 - paper_room().vertices).transpose(2, 0, 1)).min(axis=1).max() < 1e-9
    for number, (x, y) in enumerate(corners):
        theta, rho = (float(made.cells(f"{number + 1} {name}")[0]) for name in ("theta (rad)", "rho (cm)"))
        assert x * np.cos(theta) + y * np.sin(theta) == pytest.approx(rho, abs=0.02)


def test_the_recording_steps_through_the_survey_and_holds_the_figures(made: Reproduced) -> None:
    reader = rerun.chunk.RrdReader(made.folder / "survey.rrd")
    (recording,) = reader.recordings()
    assert recording.application_id == rerun_paths.APPLICATION_ID
    assert reader.blueprints()
    sweeps: dict[str, set[int]] = {}
    statics = set()
    for chunk in reader.stream(store=recording).to_chunks():
        if chunk.is_static:
            statics.add(chunk.entity_path)
        elif rerun_paths.SWEEP in chunk.timeline_names:
            column = chunk.to_record_batch().column(rerun_paths.SWEEP)
            sweeps.setdefault(chunk.entity_path, set()).update(column.to_pylist())
    every = set(range(len(paper_path())))
    for path in (
        rerun_paths.WALLS,
        rerun_paths.CORNERS,
        rerun_paths.CYLINDERS,
        rerun_paths.FEATURES,
        rerun_paths.unit_rays("u1"),
    ):
        assert sweeps[f"/{path}"] == every
    assert any(path.startswith(f"/{rerun_paths.GRID}/") for path in sweeps)
    assert {f"/figures/figure_{number:02d}" for number in FIGURES} | {"/report"} <= statics


def test_the_recording_ends_with_the_contour_of_the_first_seed(made: Reproduced) -> None:
    reader = rerun.chunk.RrdReader(made.folder / "survey.rrd")
    radii_m = {}
    for chunk in reader.stream(store=reader.recordings()[0]).to_chunks():
        batch = chunk.to_record_batch()
        if "Ellipses2D:half_sizes" in batch.schema.names:
            sizes = batch.column("Ellipses2D:half_sizes").to_pylist()
            radii_m |= dict(zip(batch.column(rerun_paths.SWEEP).to_pylist(), sizes, strict=True))
    radius_m = mapped(SEEDS[0], "refined").cylinders[0].radius_m
    assert radii_m[len(paper_path()) - 1] == [pytest.approx([radius_m, radius_m], abs=1e-6)]
    assert radii_m[0] == [], "one sweep shows no cylinder"


def test_the_same_seeds_give_the_same_figures_over_any_number_of_processes() -> None:
    alone, together = run_all(SEEDS), run_all(SEEDS, jobs=2)
    for method in METHODS:
        assert str(compare(alone, method)) == str(compare(together, method))  # as text, for NaN is not NaN
    first, second = (corner_values(run.contours["refined"]) for run in alone)
    assert np.abs(first - second).max() > 0.01, "another seed is another survey"


def test_a_contour_that_misses_a_corner_counts_it_missed_and_an_invented_one_surplus() -> None:
    (run,) = run_all(SEEDS[:1])
    whole = run.contours["refined"]
    one_less = Contour(whole.walls, whole.corners[1:], whole.cylinders * 2)
    run.contours["refined"] = one_less
    counted = compare([run], "refined")
    assert (counted.missed, counted.surplus) == (1, 1)
    assert np.isnan(corner_values(one_less)).any(axis=1).sum() == 1


def test_walls_are_compared_under_the_theta_and_rho_of_table_1() -> None:
    # The mapper turns normals out of the room; Table I has theta from 0 to pi.
    values = wall_values(mapped(SEEDS[0], "refined"))
    assert values == pytest.approx(np.array(paper.LINES["true"]), abs=1.5)
    assert values[:, 0] == pytest.approx(np.array(paper.LINES["true"])[:, 0], abs=0.02)


@pytest.fixture
def mappers_host(tmp_path: Path) -> dict[str, str]:
    """The environment of a host that has the mapper and what it depends on, but no reproduction of the paper."""
    packages = tmp_path / "packages"
    packages.mkdir()
    for installed in Path(sysconfig.get_path("purelib")).iterdir():
        if not installed.name.startswith(("noctule_reproduction", "matplotlib", "mpl_toolkits")):
            (packages / installed.name).symlink_to(installed)
    sources = [ROOT / "sdk/src", ROOT / "mapper/src"]
    return os.environ | {"PYTHONPATH": os.pathsep.join(map(str, [packages, *sources]))}


def on_host(environment: dict[str, str], *arguments: object) -> subprocess.CompletedProcess[str]:
    # -S: without the folder of packages that this interpreter has itself.
    script = "from noctule_mapper.cli import main; main()"
    command = [sys.executable, "-S", "-c", script, *map(str, arguments)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def test_a_mappers_host_is_told_which_package_reproduces(mappers_host: dict[str, str], tmp_path: Path) -> None:
    asked = on_host(mappers_host, "reproduce", "--out", tmp_path / "paper")
    assert asked.returncode == 1
    assert asked.stderr.startswith("noctule-mapper: ")
    assert "noctule-reproduction" in asked.stderr
    assert "Traceback" not in asked.stderr
    assert not (tmp_path / "paper").exists()


def test_a_mappers_host_fits_without_the_reproduction_and_matplotlib(
    mappers_host: dict[str, str], tmp_path: Path
) -> None:
    source, contour = tmp_path / "survey.jsonl", tmp_path / "contour.json"
    with source.open("w") as stream:
        write(paper_survey(), stream)
    fitted = on_host(mappers_host, "fit", source, "--contour", contour)
    assert fitted.returncode == 0, fitted.stderr
    assert len(json.loads(contour.read_text())["walls"]) == len(paper_room().vertices)
