"""Fields of a site file are set, and all its other lines stay as they are, comments and all."""

import re
import tempfile
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.container import OutOfOrderTableProxy
from tomlkit.items import Table

from noctule import site
from noctule.errors import SiteFileError
from noctule_mapper.export.atomic_write import write_whole


@dataclass(frozen=True)
class Edit:
    """Set ``fields`` in the table ``table`` of the unit, or of the site where ``unit`` is None. What stands there and
    is no table (pose = "unknown") is replaced.
    """

    unit: str | None
    table: str
    fields: dict[str, float]


def write_edits(path: Path, edits: Sequence[Edit]) -> site.Site:
    """Carry out ``edits``, all other lines staying byte for byte; the site as it then is.

    Raises SiteFileError, the file as it was, where it is not a good site file, has no such unit or can't be edited.
    """
    before = site.load(path)
    for edit in edits:
        if edit.unit is not None:
            before.unit(edit.unit)
    data = path.read_bytes()
    text = data.decode("utf-8-sig")
    mark = data.removesuffix(text.encode())  # some editors begin with a byte order mark
    new = edited(text, edits)
    if tomllib.loads(new) != _expected(text, edits):
        fields = ", ".join(f"{edit.unit or 'site'}.{edit.table} {edit.fields}" for edit in edits)
        raise SiteFileError(f"{path} is written in a way that can't be edited: enter by hand {fields}")
    with tempfile.TemporaryDirectory() as folder:
        trial = Path(folder) / path.name
        trial.write_bytes(mark + new.encode())
        after = site.load(trial)
    write_whole({path: mark + new.encode()})
    return after


def edited(text: str, edits: Sequence[Edit]) -> str:
    """The site file ``text`` with ``edits``."""
    document: Any = tomlkit.parse(text)
    for edit in edits:
        _edit(_holder(document, edit.unit), edit)
    new = tomlkit.dumps(document)
    only_crlf = "\r\n" in text and not re.search(r"(?<!\r)\n", text)
    return re.sub(r"(?<!\r)\n", "\r\n", new) if only_crlf else new


def _edit(holder: Any, edit: Edit) -> None:
    if edit.table not in holder:
        _add(holder, edit.table, tomlkit.table() if edit.unit is None else tomlkit.inline_table())
    elif not isinstance(holder[edit.table], dict):
        holder[edit.table] = tomlkit.inline_table()
    for key, value in edit.fields.items():
        if key in holder[edit.table]:
            holder[edit.table][key] = value
        else:
            _add(holder[edit.table], key, value)


def _holder(document: Any, unit: str | None) -> Any:
    """The table that holds the edited one."""
    return document if unit is None else next(each for each in document["unit"] if each["name"] == unit)


def _add(table: Any, key: str, value: Any) -> None:
    """Put a new key after the last one: the comments and empty lines that follow belong to the next table."""
    if isinstance(table, OutOfOrderTableProxy):  # dotted keys, each on a line of its own
        table[key] = value
        return
    trailing = []
    if isinstance(table, Table):
        body = table.value.body
        while body and body[-1][0] is None:
            trailing.append(body.pop()[1])
    table.add(key, value)
    for item in reversed(trailing):
        table.add(item)


def _expected(text: str, edits: Sequence[Edit]) -> dict[str, Any]:
    entries = tomllib.loads(text)
    for edit in edits:
        holder = _holder(entries, edit.unit)
        there = holder.get(edit.table, {})
        holder[edit.table] = (there if isinstance(there, dict) else {}) | edit.fields
    return entries
