"""Whether a command of a page can be: the program's own parser knows each of its words. Raises UnknownError."""

import re
import shlex
import subprocess
from collections.abc import Callable, Sequence
from functools import cache

import typer
from system.processes import ROOT

import noctule.cli
import noctule_deploy.cli
import noctule_gateway.cli
import noctule_mapper.cli
import noctule_viewer.cli

APPS = {
    "noctule": noctule.cli.commands,
    "noctule-deploy": noctule_deploy.cli.app,
    "noctule-gateway": noctule_gateway.cli.app,
    "noctule-mapper": noctule_mapper.cli.app,
    "noctule-viewer": noctule_viewer.cli.app,
}
_OF_OTHERS = ("caddy", "cd", "cmp", "docker", "export", "mkdir", "objcopy", "rsync", "ssh", "sudo")
"""Programs that are not ours: the shell parses their lines."""


class UnknownError(Exception):
    """A word that the program does not know."""


def is_command(line: str) -> bool:
    """The line begins with a program that the pages use."""
    words = _without_settings(line.split())
    return bool(words) and words[0] in _PARSERS


def parse(line: str) -> None:
    """Check a line of one or more commands; ``[...]`` may be left out, and WORDS in capitals stand for others."""
    for part in re.split(r"&&|;", line):
        words = _without_settings(shlex.split(re.sub(r"[\[\]]|\.\.\.", "", part)))
        if words:
            if words[0] not in _PARSERS:
                raise UnknownError(f"{words[0]} is no program of the project, nor of tests/docs/parsing.py")
            _PARSERS[words[0]](words)


def _without_settings(words: Sequence[str]) -> list[str]:
    words = list(words)
    while words and re.match(r"[A-Z_]+=", words[0]):
        words.pop(0)
    return words


def _ours(words: Sequence[str]) -> None:
    command = typer.main.get_command(APPS[words[0]])
    waiting, positional = list(words[1:]), 0
    while waiting:
        word = waiting.pop(0)
        if word.startswith("--"):
            name, given, _ = word.partition("=")
            option = next((one for one in command.params if name in (*one.opts, *one.secondary_opts)), None)
            if option is None and name not in ("--help", "--install-completion"):
                raise UnknownError(f"{command.name or words[0]} has no option {name}")
            if option is not None and not getattr(option, "is_flag", False) and not given:
                if not waiting:
                    raise UnknownError(f"{name} needs a value")
                waiting.pop(0)
            continue
        arguments = [one for one in command.params if one.param_type_name == "argument"]
        if positional < len(arguments):
            positional += 1
        elif (below := getattr(command, "commands", None)) is None:
            raise UnknownError(f"{command.name} takes no {word}")
        elif word in below:
            command, positional = below[word], 0
        elif word == "COMMAND":
            return
        else:
            raise UnknownError(f"{command.name or words[0]} has no command {word}")


def _simulator(words: Sequence[str]) -> None:
    for word in words[1:]:
        if word.startswith("--") and word not in _simulator_options():
            raise UnknownError(f"noctule-sim has no option {word}")


@cache
def _simulator_options() -> set[str]:
    told = subprocess.run(["noctule-sim", "--help"], check=True, capture_output=True, text=True).stdout
    return set(re.findall(r"--[a-z-]+", told))


def _make(words: Sequence[str]) -> None:
    folder = words[words.index("-C") + 1] if "-C" in words else "."
    targets = re.findall(r"^([a-z][a-z /.-]*):", (ROOT / folder / "Makefile").read_text(), re.MULTILINE)
    known = {target for line in targets for target in line.split()}
    for word in words[1:]:
        if word not in ("-C", folder) and "=" not in word and word not in known:
            raise UnknownError(f"{folder}/Makefile has no target {word}")


def _files(words: Sequence[str]) -> None:
    """A tool that is given files of the project, whose options are its own."""
    for word in words[1:]:
        if "/" in word and not (ROOT / word.split("::")[0]).exists():
            raise UnknownError(f"there is no {word}")


def _shell(words: Sequence[str]) -> None:
    if subprocess.run(["sh", "-n", "-c", shlex.join(words)], check=False).returncode:
        raise UnknownError(f"the shell does not take {shlex.join(words)}")


_PARSERS: dict[str, Callable[[Sequence[str]], None]] = {
    **dict.fromkeys(APPS, _ours),
    **dict.fromkeys(("pytest", "python", "cargo"), _files),
    **dict.fromkeys(_OF_OTHERS, _shell),
    "noctule-sim": _simulator,
    "make": _make,
}
