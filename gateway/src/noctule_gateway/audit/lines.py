"""The lines of an audit log, and its files: ``audit-1.jsonl``, ``audit-2.jsonl`` and so on, or ``refused-1.jsonl``.

A line is a JSON object. Its last member, ``hash``, is BLAKE2b (16 bytes) over the hash of the line before and the
object without this member: a line that was changed, taken out or moved shows. The first line of a file names the hash
that it goes on from (``after``), so that the files are one chain. The hash has no key: who can write the files can also
make a whole new chain. The number of lines in the gateway's status, and the hashes in its program log, tell that.
"""

import json
import re
from hashlib import blake2b
from pathlib import Path
from typing import Any

from noctule_gateway.errors import AuditError

Facts = dict[str, Any]

BEGINNING = "0" * 32  # what the first line of all goes on from

_LINE = re.compile(rb'(\{.*),"hash":"([0-9a-f]{32})"\}')


def files(folder: Path, family: str = "audit") -> list[tuple[int, Path]]:
    """The files of an audit log by their numbers, oldest first; ``family`` begins their names."""
    name = re.compile(rf"{family}-([1-9]\d{{0,8}})\.jsonl")
    return sorted((int(found[1]), path) for path in folder.glob("*.jsonl") if (found := name.fullmatch(path.name)))


def file_name(number: int, family: str = "audit") -> str:
    """The name of a file of an audit log."""
    return f"{family}-{number}.jsonl"


def written(facts: Facts, before: str) -> tuple[bytes, str]:
    """The line of ``facts`` after one with the hash ``before``, and its own hash."""
    body = json.dumps(facts, separators=(",", ":")).encode()[:-1]
    own = _hash(body, before)
    return body + b',"hash":"' + own.encode() + b'"}\n', own


def read(line: bytes, before: str | None) -> tuple[Facts, str]:
    """What a line, without its end, holds, and its hash. Raises AuditError: it is none, or does not follow ``before``.

    Without ``before``, the line is the first of a file and says what it goes on from.
    """
    found, facts = _LINE.fullmatch(line), _facts(line)
    if found is None or facts is None:
        raise AuditError("is no line of an audit log, or was cut")
    before = str(facts.get("after", "")) if before is None else before
    if _hash(found[1], before) != found[2].decode():
        raise AuditError("was changed, or the line before it was changed or taken out")
    return facts, found[2].decode()


def claimed(line: bytes) -> tuple[int, str] | None:
    """Number and hash of a line, as it says itself; None where it is none."""
    found, facts = _LINE.fullmatch(line), _facts(line)
    return None if found is None or facts is None else (facts["number"], found[2].decode())


def _facts(line: bytes) -> Facts | None:
    try:
        facts = json.loads(line)
    except (ValueError, RecursionError):
        return None
    return facts if isinstance(facts, dict) and type(facts.get("number")) is int else None


def _hash(body: bytes, before: str) -> str:
    return blake2b(before.encode() + body, digest_size=16).hexdigest()
