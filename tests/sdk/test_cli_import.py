"""noctule import as people run it: a scanner's file in, a survey out, and one line where that can't be."""

import subprocess
import sys
from pathlib import Path

import pytest

from noctule import survey

NOCTULE = Path(sys.executable).with_name("noctule")
CM = ("--angle", "1", "--range", "2", "--units", "cm")
# What the best-known Arduino radar writes: "angle,distance." without a line's end, cut off where the log was stopped.
RADAR = "".join(f"{angle},{120 + angle % 7}." for angle in [*range(15, 166), *range(165, 14, -1)]) + "15,1"


def run(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([NOCTULE, "import", *arguments], cwd=folder, capture_output=True, text=True, timeout=120)


@pytest.fixture
def radar(tmp_path: Path) -> Path:
    (tmp_path / "radar.txt").write_text(RADAR)
    (tmp_path / "header.csv").write_text("angle,distance_cm\n")
    (tmp_path / "scan.jsonl").write_text('{"angle": 45, "range": 30}\n')
    return tmp_path


def test_a_serial_log_becomes_a_survey_beside_it(radar: Path) -> None:
    done = run(radar, "radar.txt", "--angle", "1", "--range", "2", "--units", "cm")
    assert (done.returncode, done.stdout) == (
        0,
        "radar.jsonl: 302 readings, 302 echoes, 2 passes, 1 place: 6 sweeps\n",
    )
    assert done.stderr == "noctule: radar.txt: line 1, reading 303 was left out, no reading: '15,1'\n"
    sweeps = list(survey.read(radar / "radar.jsonl"))
    assert sum(len(sweep.readings) for sweep in sweeps) == 302
    assert all(sweep.HasField("pose") for sweep in sweeps)


def test_a_survey_goes_into_mcap_by_its_name(radar: Path) -> None:
    options = (
        "--angle",
        "1",
        "--range",
        "2",
        "--units",
        "cm",
        "--pose",
        "1.5,-0.5,90",
        "--unit",
        "u7",
        "--site",
        "attic",
    )
    assert run(radar, "radar.txt", "--out", "radar.mcap", *options).returncode == 0
    first = next(survey.read(radar / "radar.mcap"))
    assert (first.site, first.unit, first.pose.x_m, first.pose.y_m) == ("attic", "u7", 1.5, -0.5)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("radar.txt", "--angle", "1", "--range", "2"), "radar.txt, column '2': does not say in which unit"),
        (("nowhere.csv", "--angle", "1", "--range", "2", "--units", "m"), "nowhere.csv: can't be read: No such file"),
        (("radar.txt", "--angle", "1", "--range", "7", "--units", "cm"), "no figures in the columns asked for"),
        (
            ("scan.jsonl", "--angle", "angle", "--range", "range", "--units", "cm", "--out", "scan.jsonl"),
            "the scan itself",
        ),
        (("radar.txt", *CM, "--out", 246 * "n" + ".jsonl"), "can't be written"),  # it is 258 long until it is whole
        (("nowhere.csv", "--angle", "1", "--range", "2", "--out", "no/where.jsonl"), "there is no folder"),
        (("header.csv", "--angle", "angle", "--range", "2"), "'angle,distance_cm', and holds no readings below"),
    ],
)
def test_what_can_not_be_imported_is_told_in_one_line_and_leaves_nothing(radar: Path, arguments, complaint) -> None:
    done = run(radar, *arguments)
    assert done.returncode == 1
    assert done.stderr.startswith("noctule: ")
    assert done.stderr.count("\n") == 1
    assert complaint in done.stderr
    assert sorted(path.name for path in radar.iterdir()) == ["header.csv", "radar.txt", "scan.jsonl"]


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("--out", "radar.csv"), "no .csv file: name it radar.jsonl or radar.mcap"),
        (("--pose", "1,2"), "give X,Y,HEADING"),
        (("--pose", "1,2,nan"), "HEADING is nan"),
        (("--x", "3"), "a place takes --x and --y"),
        (("--site", "My Room"), "can't be part of a key"),
        (("--air-temperature-c", "293"), "--air-temperature-c"),
    ],
)
def test_an_option_that_makes_no_sense_is_refused(radar: Path, arguments, complaint) -> None:
    done = run(radar, "radar.txt", "--angle", "1", "--range", "2", "--units", "cm", *arguments)
    assert done.returncode == 2
    assert complaint in " ".join(done.stderr.replace("│", " ").split())
    assert not (radar / "radar.jsonl").exists()


def test_a_survey_that_is_there_is_written_over_only_where_that_was_asked_for(radar: Path) -> None:
    kept = radar / "radar.jsonl"
    kept.write_text("mine\n")
    options = ("radar.txt", "--angle", "1", "--range", "2", "--units", "cm")
    refused = run(radar, *options)
    assert refused.returncode == 1
    assert "radar.jsonl is there already: name another file with --out, or write over it with --force" in refused.stderr
    assert kept.read_text() == "mine\n"
    assert run(radar, *options, "--force").returncode == 0
    assert len(list(survey.read(kept))) == 6
