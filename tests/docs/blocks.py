"""The code blocks of the project's Markdown pages, and the commands in them."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from system.processes import ROOT

_FENCE = re.compile(r"^\s*```(\w*)")
_INLINE = re.compile(r"`([^`\n]+)`")


@dataclass(frozen=True)
class Block:
    """A block of code: the lines of a page from ``line``, without their indentation."""

    page: str
    line: int
    language: str
    text: str

    @property
    def first(self) -> str:
        return self.text.split("\n", 1)[0]


@dataclass(frozen=True)
class Command:
    """One command line of a page, without its comment."""

    page: str
    line: int
    text: str

    def __str__(self) -> str:
        return f"{self.page}:{self.line}: {self.text}"


def blocks(page: Path) -> Iterator[Block]:
    """The fenced and the indented blocks of a page."""
    lines, number, name = page.read_text().split("\n"), 0, str(page.relative_to(ROOT))
    while number < len(lines):
        if fence := _FENCE.match(lines[number]):
            end = next(at for at in range(number + 1, len(lines)) if _FENCE.match(lines[at]))
            yield Block(name, number + 2, fence[1], "\n".join(lines[number + 1 : end]))
            number = end + 1
        elif lines[number].startswith("    ") and not lines[number - 1].strip():
            end = next((at for at in range(number, len(lines)) if not _goes_on(lines, at)), len(lines))
            indent = len(lines[number]) - len(lines[number].lstrip())
            yield Block(name, number + 1, "", "\n".join(line[indent:] for line in lines[number:end]).rstrip())
            number = end
        else:
            number += 1


def _goes_on(lines: list[str], at: int) -> bool:
    if lines[at].strip():
        return lines[at].startswith("    ")
    return any(line.startswith("    ") for line in lines[at + 1 : at + 2])


def inline(page: Path) -> Iterator[Command]:
    """What stands in backticks within the text, outside of blocks."""
    name = str(page.relative_to(ROOT))
    for number, line in enumerate(page.read_text().split("\n"), start=1):
        if not line.startswith("    "):
            for code in _INLINE.findall(line):
                yield Command(name, number, code)


def commands(block: Block) -> Iterator[Command]:
    """The command lines of a block of commands, comments and line ends with a backslash taken away."""
    for number, line in enumerate(block.text.split("\n"), start=block.line):
        if text := re.sub(r"(^|\s)#.*$", "", line).strip():
            yield Command(block.page, number, text)
