"""The pages wrap at 120 columns, except where a line can't be broken: tables, code, and a link on its own."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from docs.blocks import blocks
from readmes import pages

COLUMNS = 120
_LINK = re.compile(r"[-*\s(]*!?\[[^\]]*\]\([^)]*\)[\s).,:;]*")  # and nothing else


def too_wide(page: Path) -> Iterator[tuple[int, int]]:
    """The lines of a page that are too wide: number and columns."""
    code = {block.line + number for block in blocks(page) for number in range(block.text.count("\n") + 1)}
    for number, line in enumerate(page.read_text().split("\n"), start=1):
        if len(line) > COLUMNS and not (line.startswith("|") or number in code or _LINK.fullmatch(line)):
            yield number, len(line)


def test_no_line_of_the_pages_is_too_wide() -> None:
    assert len(pages()) > 15
    wide = [f"{page}:{line}: {columns} columns" for page in pages() for line, columns in too_wide(page)]
    assert not wide, "\n".join(wide)


def test_text_is_too_wide_and_a_table_code_or_a_link_on_its_own_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("docs.blocks.ROOT", tmp_path)
    page, long = tmp_path / "page.md", "word" + 25 * " word"  # 129 columns
    link = f"- [{long}](page.md):"
    may_be = ["x" * COLUMNS, f"| {long} |", link, "", f"    {long}", "", "```", long, "```"]
    page.write_text("\n".join([long, *may_be, f"{link} see", f"- {long}", f"    {long}"]))
    assert list(too_wide(page)) == [(1, 129), (11, 129 + 18), (12, 131), (13, 133)]
