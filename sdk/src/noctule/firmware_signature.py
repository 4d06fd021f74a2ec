"""Signatures of firmware images: one line of the Intel HEX file for each key that has signed it.

``;noctule signature 1 KEYID BASE64`` is an Ed25519 signature over all other lines of the file. The line begins with
``;`` because readers of Intel HEX pass over such a line after the end record. Line ends are not signed: mail and
editors change them.
"""

import re
from base64 import b64decode, b64encode
from binascii import Error as Base64Error
from collections.abc import Iterable
from dataclasses import dataclass
from hashlib import sha256
from typing import TYPE_CHECKING

from noctule.errors import FirmwareKeyError, ImageSignatureError, NoSignatureError, UnknownKeyError

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

_MARK = ";noctule signature"
_LINE = re.compile(rf"{_MARK} 1 ([0-9a-f]{{16}}) ([A-Za-z0-9+/]{{86}}==)")  # 64 bytes
_END_RECORD = ":00000001FF"
_CONTEXT = "noctule firmware 1\n"  # so that the key's signature of anything else is none of an image
_PUBLIC_BYTES = 32
MAX_SIGNATURES = 8  # of one image: a fleet changes from one key to the next, and checking takes time


@dataclass(frozen=True)
class PublicKey:
    """A key that images may be signed with; ``public`` is its public half, 32 bytes."""

    name: str
    public: bytes

    @property
    def id(self) -> str:
        """The key as signature lines name it: the first 16 digits of its SHA-256."""
        return sha256(self.public).hexdigest()[:16]

    def __str__(self) -> str:
        return f"{self.name} ({self.id})"


def public_key(name: str, text: str) -> PublicKey:
    """The key from its base64. Raises FirmwareKeyError."""
    try:
        public = b64decode(text, validate=True)
    except (Base64Error, ValueError) as error:
        raise FirmwareKeyError(f"the firmware key {name!r} is not base64: {_COPY}") from error
    if len(public) != _PUBLIC_BYTES:
        raise FirmwareKeyError(f"the firmware key {name!r} has {len(public)} bytes and not {_PUBLIC_BYTES}: {_COPY}")
    return PublicKey(name, public)


def to_text(public: bytes) -> str:
    """The base64 of a public key."""
    return b64encode(public).decode()


def sign(image: bytes, key: "Ed25519PrivateKey") -> bytes:
    """The image with a signature by ``key`` as its last line, in place of an earlier one by this key.

    Raises ImageSignatureError: it is cut or no Intel HEX file, or has a damaged signature.
    """
    own = PublicKey("", key.public_key().public_bytes_raw()).id
    signed, signatures = _taken_apart(image)
    if _END_RECORD not in signed:
        raise ImageSignatureError("it has no end record, so it is cut or no Intel HEX file: take build/update.hex")
    kept = [(key_id, signature) for key_id, signature in signatures if key_id != own]
    kept.append((own, key.sign(_message(signed))))
    lines = [f"{_MARK} 1 {key_id} {b64encode(signature).decode()}" for key_id, signature in kept]
    return "".join(f"{line}\n" for line in (*signed, *lines)).encode("ascii")


def check(image: bytes, keys: Iterable[PublicKey]) -> PublicKey:
    """The first of ``keys`` that has signed the image.

    Raises NoSignatureError, UnknownKeyError, or ImageSignatureError: a line was cut or damaged, or the image is not the
    one that was signed.
    """
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

    known = {key.id: key for key in keys}
    signed, signatures = _taken_apart(image)
    if not signatures:
        raise NoSignatureError("it is not signed: sign it (noctule-deploy firmware-sign), or take the released file")
    named = [(known[key_id], signature) for key_id, signature in signatures if key_id in known]
    if not named:
        signers = ", ".join(key_id for key_id, _ in signatures)
        takes = ", ".join(map(str, known.values())) or "none"
        raise UnknownKeyError(f"it is signed by key {signers}, which is not known here; keys that are: {takes}")
    message = _message(signed)
    for key, signature in named:
        try:
            Ed25519PublicKey.from_public_bytes(key.public).verify(signature, message)
        except (InvalidSignature, ValueError):
            continue
        return key
    signer = ", ".join(str(key) for key, _ in named)
    raise ImageSignatureError(f"it is not what {signer} has signed: it was changed after that. Copy it again")


_COPY = "copy what noctule-deploy firmware-key printed"


def _taken_apart(image: bytes) -> tuple[list[str], list[tuple[str, bytes]]]:
    """The lines that are signed, and the signatures with their keys' ids. Raises ImageSignatureError."""
    try:
        text = image.decode("ascii")
    except UnicodeDecodeError as error:
        raise ImageSignatureError(f"it is not an Intel HEX file: {error}") from error
    lines = [stripped for line in text.splitlines() if (stripped := line.strip())]
    signed: list[str] = []
    signatures: list[tuple[str, bytes]] = []
    for line in lines:
        if found := _LINE.fullmatch(line):
            signatures.append((found[1], b64decode(found[2])))
        elif line.startswith(_MARK) or (line.startswith(";") and _MARK.startswith(line)):
            raise ImageSignatureError(f"its line {line[:40]!r} is cut or damaged: copy the file again")
        else:
            signed.append(line)
    if len(signatures) > MAX_SIGNATURES:
        count = f"{len(signatures)} signatures, and {MAX_SIGNATURES} are allowed"
        raise ImageSignatureError(f"it has {count}: remove lines of old keys")
    return signed, signatures


def _message(lines: Iterable[str]) -> bytes:
    return (_CONTEXT + "".join(f"{line}\n" for line in lines)).encode("ascii")
