"""Every command, option and argument of the programs says in its help what it is, in words that reach the reader."""

import re
from collections.abc import Iterator
from typing import Any

import typer
from docs.parsing import APPS

_SENTENCE = re.compile(r"\w{2}.*\.$", re.DOTALL)
_MARKUP = re.compile(r"\[/?[a-z#@]")  # Rich takes [window] for a style and leaves it out


def commands() -> Iterator[tuple[str, Any]]:
    """Every command with its name."""
    waiting = [(program, typer.main.get_command(app)) for program, app in APPS.items()]
    while waiting:
        name, command = waiting.pop()
        yield name, command
        waiting += [(f"{name} {below}", each) for below, each in getattr(command, "commands", {}).items()]


def helps() -> Iterator[tuple[str, str]]:
    """Of each command and of each of its options and arguments, its name and its help."""
    for name, command in commands():
        yield name, command.help or ""
        yield from ((f"{name} {one.name}", getattr(one, "help", None) or "") for one in command.params)


def test_each_help_is_a_sentence_and_all_of_it_is_shown() -> None:
    found = dict(helps())
    assert len(found) > 250
    wrong = [f"{name}: {said!r}" for name, said in found.items() if not _SENTENCE.search(said) or _MARKUP.search(said)]
    assert not wrong, "\n".join(wrong)


def test_what_can_be_given_several_times_is_called_by_what_one_of_it_is() -> None:
    several = {
        f"{name} {one.name}": one.metavar for name, command in commands() for one in command.params if _many(one)
    }
    assert len(several) > 20
    assert not (wrong := [name for name, metavar in several.items() if not metavar]), wrong  # else Python's list[str]


def _many(parameter: Any) -> bool:
    return getattr(parameter, "multiple", False) or parameter.nargs == -1
