"""Who gives a command: the attachment of its query, made by the client and checked by the gateway.

Zenoh tells a gateway nothing of who asks. Where the bus has certificates, the client therefore signs each command with
its certificate's key, and nobody can give a command in another's name. A captured command can be sent again only by
those who pass it on, the routers and the gateway. Without certificates, the session's id is all there is, and the
client could say another.
"""

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from noctule import bounds, tls
from noctule.errors import BoundsError, CallerError
from noctule.keys import Role
from noctule.messages_pb2 import Caller
from noctule.operators import Operators

if TYPE_CHECKING:
    from cryptography.x509 import Certificate

_LONGEST_CLAIM = 128  # characters
_CONTEXT = b"noctule command 1\n"  # so that a signature of anything else is none of a command


@dataclass(frozen=True)
class Who:
    """Who gave a command: ``name`` is a certificate's, checked, or ``session ID`` as it says itself, not signed."""

    name: str
    signed: bool


def attachment(session: str, tls_folder: Path | None, key: str, payload: bytes) -> bytes:
    """The attachment of a command's query, signed where there is a TLS folder (``tls.chosen``). Raises TlsError."""
    caller = Caller(session=session)
    identity = tls.chosen(tls_folder)
    if identity is not None:
        caller.certificate, caller.signature = _sign(identity.folder, key, payload)
    return caller.SerializeToString()


class Callers:
    """Checks who gives commands, for a gateway; ``tls_folder`` is its own, None on a bus without certificates."""

    def __init__(self, tls_folder: Path | None = None) -> None:
        """Raises TlsError."""
        identity = tls.chosen(tls_folder)
        self._authority = None if identity is None else tls.read_certificate(identity.folder / tls.AUTHORITY)
        self._operators = None if identity is None else Operators(identity.folder)

    def look(self) -> None:
        """See whether other operators are admitted now; to be called now and again. It reads a file."""
        if self._operators is not None:
            self._operators.look()

    @property
    def detail(self) -> str:
        """What is wrong with the list of operators, for the gateway's status; empty if nothing is."""
        return "" if self._operators is None else self._operators.detail

    def who(self, attached: bytes, key: str, payload: bytes) -> Who:
        """Who gave the command on ``key``. Raises CallerError."""
        try:
            caller = bounds.decode(Caller, attached)
        except BoundsError as error:
            if self._authority is not None:
                raise CallerError(f"the command does not say who gives it: {error}") from error
            return _session("")
        if self._authority is None or self._operators is None:
            return _session(caller.session)
        if not caller.certificate:
            raise CallerError("the command is not signed: give it by noctule or its client, with --tls FOLDER")
        name = _checked(caller, self._authority, key, payload)
        if not self._operators.admit(name):
            raise CallerError(
                f"the command is signed by {name}, which was revoked or is not for this site; where it is new, copy "
                "the gateway's folder of noctule-deploy render to its host"
            )
        return Who(name, signed=True)


def claimed(attached: bytes) -> Who:
    """Who an attachment says has given a command, true or not: for a record of what was refused."""
    from cryptography import x509
    from cryptography.exceptions import UnsupportedAlgorithm

    try:
        caller = bounds.decode(Caller, attached)
    except BoundsError:
        return _session("")
    if not caller.certificate:
        return _session(caller.session)
    try:
        name = tls.common_name_of(x509.load_der_x509_certificate(caller.certificate))
    except (ValueError, TypeError, UnsupportedAlgorithm):
        name = "a certificate that can't be read"
    return Who(name[:_LONGEST_CLAIM], signed=False)


def _session(said: str) -> Who:
    return Who(f"session {said or '?'}", signed=False)


def _checked(caller: Caller, authority: "Certificate", key: str, payload: bytes) -> str:
    """The common name of the certificate that has signed the command. Raises CallerError."""
    from cryptography import x509
    from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
    from cryptography.hazmat.primitives import hashes
    from cryptography.hazmat.primitives.asymmetric import ec

    try:
        certificate = x509.load_der_x509_certificate(caller.certificate)
        certificate.verify_directly_issued_by(authority)
        name = tls.common_name_of(certificate)
        public = certificate.public_key()
        if not isinstance(public, ec.EllipticCurvePublicKey):
            raise TypeError("its key is not on an elliptic curve")
        public.verify(caller.signature, _message(key, payload), ec.ECDSA(hashes.SHA256()))
    except (ValueError, TypeError, InvalidSignature, UnsupportedAlgorithm) as error:
        raise CallerError(
            "the command's signature does not hold: it was changed on its way, or is by another fleet's certificate"
        ) from error
    now = datetime.now(UTC)
    if now > certificate.not_valid_after_utc:
        raise CallerError(f"the command is signed by {name}, whose certificate has expired: renew it")
    if now < certificate.not_valid_before_utc:
        begins = f"{certificate.not_valid_before_utc:%Y-%m-%d %H:%M} UTC"
        raise CallerError(
            f"the command is signed by {name}, whose certificate is valid from {begins}, and this gateway's clock says "
            f"{now:%Y-%m-%d %H:%M}: set the clock"
        )
    if name.partition(".")[0] != Role.OPERATOR:
        raise CallerError(f"the command is signed by {name}: only operators command units")
    return name


def _sign(folder: Path, key: str, payload: bytes) -> tuple[bytes, bytes]:
    """Certificate (DER) and signature."""
    from cryptography.hazmat.primitives import hashes
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.hazmat.primitives.serialization import Encoding, load_pem_private_key

    private = load_pem_private_key((folder / tls.PRIVATE_KEY).read_bytes(), password=None)
    assert isinstance(private, ec.EllipticCurvePrivateKey)  # noctule-deploy makes no other
    signature = private.sign(_message(key, payload), ec.ECDSA(hashes.SHA256()))
    return tls.read_certificate(folder / tls.CERTIFICATE).public_bytes(Encoding.DER), signature


def _message(key: str, payload: bytes) -> bytes:
    return _CONTEXT + key.encode() + b"\n" + payload
