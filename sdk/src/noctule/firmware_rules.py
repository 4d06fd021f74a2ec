"""Which firmware images a gateway gives its units: the file ``firmware.toml``.

``noctule-deploy render`` writes it into the folders of gateways and routers, and the gateway reads it.
"""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from noctule import firmware_signature, tls, toml_file
from noctule.errors import FirmwareKeyError
from noctule.firmware_signature import PublicKey

FILE = "firmware.toml"

Version = tuple[int, int, int]


@dataclass(frozen=True)
class FirmwareRules:
    """An image is to be signed by one of ``keys``, and to have version ``oldest`` or a later one."""

    keys: tuple[PublicKey, ...]
    oldest: Version = (0, 0, 0)


def chosen(named: Path | None, tls_folder: Path | None) -> FirmwareRules | None:
    """The rules of the file ``named``, else of the one in the folder of ``tls.chosen``, else none.

    Raises FirmwareKeyError, TlsError.
    """
    identity = tls.chosen(tls_folder)
    if named is None and identity is not None and (identity.folder / FILE).exists():
        named = identity.folder / FILE
    return None if named is None else load(named)


def load(path: Path) -> FirmwareRules:
    """The rules of a file. Raises FirmwareKeyError."""
    entries = toml_file.read(path, FirmwareKeyError).entries
    try:
        return _rules(entries)
    except FirmwareKeyError as error:
        raise FirmwareKeyError(f"{path}: {error}") from error


def to_toml(rules: FirmwareRules) -> str:
    """The rules as they stand in a file."""
    keys = "".join(f'{key.name} = "{firmware_signature.to_text(key.public)}"\n' for key in rules.keys)
    return f'oldest = "{".".join(map(str, rules.oldest))}"\n\n[keys]\n{keys}'


def version(text: str) -> Version:
    """The version that is written as ``0.9.0``. Raises FirmwareKeyError."""
    found = re.fullmatch(r"(\d{1,3})\.(\d{1,3})\.(\d{1,3})", text)
    if found is None:
        raise FirmwareKeyError(f"oldest is {text[:20]!r}: write a version as 0.9.0")
    return int(found[1]), int(found[2]), int(found[3])


def _rules(entries: dict[str, Any]) -> FirmwareRules:
    if unknown := sorted(set(entries) - {"keys", "oldest"}):
        raise FirmwareKeyError(f"{unknown[0]} is not known here: correct or remove it (known: keys, oldest)")
    keys, oldest = entries.get("keys"), entries.get("oldest", "0.0.0")
    if not isinstance(keys, dict) or not keys or not all(isinstance(each, str) for each in keys.values()):
        raise FirmwareKeyError('it names no keys: add a table [keys] with NAME = "BASE64"')
    return FirmwareRules(
        tuple(firmware_signature.public_key(name, text) for name, text in keys.items()), version(str(oldest))
    )
