"""Each command in the pages can be: program, subcommand and options exist. test_walk.py types those of the blocks."""

import re

import pytest
from docs.blocks import Command, blocks, commands, inline
from docs.parsing import UnknownError, is_command, parse
from readmes import pages

USAGE_COLUMN = re.compile(r"\s{2,}.*$")  # what a command does, beside it


def in_blocks() -> list[Command]:
    """The lines of every block that holds a command; the other blocks are code, files, drawings and output."""
    return [
        command
        for page in pages()
        for block in blocks(page)
        if any(is_command(line) for line in block.text.split("\n"))
        for command in commands(block)
    ]


def in_text() -> list[Command]:
    """What the text calls by a program's name and more than that."""
    return [one for page in pages() for one in inline(page) if one.text.startswith("noctule") and is_command(one.text)]


def unknown(found: list[Command]) -> list[str]:
    """What can't be, and why."""
    wrong = []
    for command in found:
        try:
            parse(USAGE_COLUMN.sub("", command.text))
        except (UnknownError, ValueError) as error:
            wrong.append(f"{command}\n    {error}")
    return wrong


@pytest.mark.parametrize(("found", "at_least"), [(in_blocks, 80), (in_text, 30)])
def test_every_command_of_the_pages_is_known_to_its_program(found, at_least: int) -> None:
    assert len(found()) >= at_least
    assert not (wrong := unknown(found())), "\n".join(wrong)


@pytest.mark.parametrize(
    "wrong",
    [
        "noctule unit attic",
        "noctule units attic --jason",
        "noctule rpc attic u7 calibrate --pings 3",
        "noctule-sim --rooms x",
        "make demos",
        "frobnicate",
    ],
)
def test_what_no_program_knows_is_found(wrong: str) -> None:
    with pytest.raises(UnknownError):
        parse(wrong)
