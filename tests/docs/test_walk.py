"""The command lines of the pages, page by page, typed as somebody would who reads them (``lines.py`` says how)."""

import re
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from docs.blocks import Command
from docs.lines import LINES, NOT_TYPED, SLOW
from docs.site_of_pages import STARTED, running_site
from docs.test_commands import USAGE_COLUMN, in_blocks
from docs.walk import Walk
from system.processes import ROOT

pytestmark = pytest.mark.timeout(1800)  # of a page, on a machine that does much else


def lines_of_pages() -> dict[str, list[Command]]:
    """By page its command lines, without what some say beside them."""
    by_page: dict[str, list[Command]] = {}
    for each in in_blocks():
        command = Command(each.page, each.line, USAGE_COLUMN.sub("", each.text))
        by_page.setdefault(each.page, []).append(command)
    return by_page


LINES_OF_PAGES = lines_of_pages()


@dataclass(frozen=True)
class Site:
    """The site that runs: its files, its bus, and the lines that were typed there."""

    folder: Path
    endpoint: str
    typed: set[str] = field(default_factory=lambda: set(STARTED))


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    folder = tmp_path_factory.mktemp("site")
    with running_site(folder) as endpoint:
        yield Site(folder, endpoint)


@pytest.mark.parametrize("page", LINES_OF_PAGES)
def test_the_lines_of_a_page_do_what_it_says(site: Site, page: str, tmp_path: Path) -> None:
    fleet = {each.text for each in LINES_OF_PAGES[page] if each.text.startswith("noctule-deploy")}  # of this page
    left_out = site.typed - fleet | NOT_TYPED.keys() | SLOW.keys()
    lines = [each for each in LINES_OF_PAGES[page] if each.text not in left_out]
    site.typed.update(each.text for each in lines)
    walk = Walk(tmp_path, site.endpoint)
    provide(tmp_path, site.folder, " ".join(each.text for each in lines), walk)
    wrong, line_before = [], 0
    for command in lines:
        if command.line > line_before + 1:  # another block: back to where one was
            walk.folder = tmp_path
        if command.text in fleet and (tmp_path / "fleet").exists():
            walk.folder = tmp_path / "fleet"
        if trouble := walk.trouble(command.text):
            wrong.append(f"{command.page}:{command.line}: {trouble}")
        line_before = command.line
    assert not wrong, "\n\n".join(wrong)


def provide(folder: Path, site: Path, lines: str, walk: Walk) -> None:
    """What other pages have made before the ``lines`` of this one: files, data, a fleet."""
    for each in site.glob("*.*"):
        if each.suffix != ".log":
            shutil.copy(each, folder)
    if "noctule record" not in lines:
        shutil.copy(site / "paper.jsonl", folder / "attic.jsonl")
    for each in ("firmware", "gateway-data", "mapper-data"):
        (folder / each).symlink_to(site / each)
    for each in ("var/lib", "run", "mnt"):
        (folder / each).mkdir(parents=True)
    if "noctule-deploy " in lines and "init" not in lines:
        for line in ("noctule-deploy init fleet", "cd fleet", "noctule-deploy render"):
            assert not (trouble := walk.trouble(line)), trouble


@pytest.mark.soak
@pytest.mark.parametrize("line", SLOW)
def test_a_line_that_takes_long_does_what_its_page_says(line: str, tmp_path: Path) -> None:
    assert not (trouble := Walk(tmp_path, "tcp/127.0.0.1:1").trouble(line)), trouble


def test_the_tables_of_lines_name_lines_of_the_pages_and_tests_that_are_there() -> None:
    of_pages = {command.text for commands in LINES_OF_PAGES.values() for command in commands}
    assert not (gone := (LINES.keys() | NOT_TYPED.keys() | SLOW.keys() | STARTED.keys()) - of_pages), gone
    tests = re.findall(r"tests/\S+\.py", (Path(__file__).parent / "lines.py").read_text())
    assert tests and not (gone := [test for test in tests if not (ROOT / test).is_file()]), gone
