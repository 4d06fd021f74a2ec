"""Parameters as the text of a TOML file.

tomlkit, which keeps the comments of a file that people edit, takes half as long to load as NumPy.
"""

import json
from collections.abc import Iterator, Mapping


def toml_text(fields: Mapping[str, object]) -> str:
    """Tables in tables of texts, finite numbers, booleans and lists of these; keys are the names of fields.

    Raises ValueError for a number that is not finite, TypeError for anything else.
    """
    return "\n".join(_lines(fields, ())).lstrip() + "\n"


def _lines(fields: Mapping[str, object], table: tuple[str, ...]) -> Iterator[str]:
    values = {key: value for key, value in fields.items() if not isinstance(value, Mapping)}
    if table and (values or not fields):
        yield f"\n[{'.'.join(table)}]"
    for key, value in values.items():
        # What JSON writes of these is TOML too.
        yield f"{key} = {json.dumps(value, ensure_ascii=False, allow_nan=False)}"
    for key, value in fields.items():
        if isinstance(value, Mapping):
            yield from _lines(value, (*table, key))
