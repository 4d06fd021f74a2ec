"""Every command, option and argument of the programs says in its help what it is, in words that reach the reader."""

import re
from collections.abc import Iterator

import typer
from docs.parsing import APPS

_SENTENCE = re.compile(r"\w{2}.*\.$", re.DOTALL)
_MARKUP = re.compile(r"\[/?[a-z#@]")  # Rich takes [window] for a style and leaves it out


def helps() -> Iterator[tuple[str, str]]:
    """Of each command and of each of its options and arguments, its name and its help."""
    for program, app in APPS.items():
        waiting = [(program, typer.main.get_command(app))]
        while waiting:
            name, command = waiting.pop()
            yield name, command.help or ""
            yield from ((f"{name} {one.name}", getattr(one, "help", None) or "") for one in command.params)
            waiting += [(f"{name} {below}", each) for below, each in getattr(command, "commands", {}).items()]


def test_each_help_is_a_sentence_and_all_of_it_is_shown() -> None:
    found = dict(helps())
    assert len(found) > 250
    wrong = [f"{name}: {said!r}" for name, said in found.items() if not _SENTENCE.search(said) or _MARKUP.search(said)]
    assert not wrong, "\n".join(wrong)
