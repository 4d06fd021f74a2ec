"""The private key that signs firmware images: Ed25519, in a PEM file that only its owner may read."""

from pathlib import Path

from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from noctule import firmware_signature, tls
from noctule.errors import ImageSignatureError
from noctule_deploy.errors import RenderError
from noctule_deploy.files import write_atomically, write_new_key


def make(path: Path) -> str:
    """Make a key in the new file ``path``; returns its public half as the fleet file takes it. Raises RenderError."""
    key = Ed25519PrivateKey.generate()
    content = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    try:
        write_new_key(path, content)
    except FileExistsError as error:
        raise RenderError(f"{path} is there already: name another file, a key is never overwritten") from error
    return firmware_signature.to_text(key.public_key().public_bytes_raw())


def sign(image: Path, key_file: Path) -> str:
    """Sign the image in its place, and return the key's id. Raises RenderError, TlsError."""
    tls.check_private(key_file)
    key = _read(key_file)
    try:
        write_atomically(image, firmware_signature.sign(image.read_bytes(), key))
    except ImageSignatureError as error:
        raise RenderError(f"{image} was not signed: {error}") from error
    return firmware_signature.PublicKey("", key.public_key().public_bytes_raw()).id


def _read(path: Path) -> Ed25519PrivateKey:
    try:
        key = serialization.load_pem_private_key(path.read_bytes(), password=None)
    except (ValueError, TypeError) as error:
        raise RenderError(f"{path} holds no private key: bring it back from your backup") from error
    if not isinstance(key, Ed25519PrivateKey):
        raise RenderError(f"{path} is a key of another kind: noctule-deploy firmware-key makes one")
    return key
