"""The folder by which a program joins a bus with mutual TLS, as ``noctule-deploy render`` makes one for each name.

It holds the authority's certificate, the program's own certificate and private key, and a Zenoh configuration with the
routers' endpoints. Whatever is wrong with it is found before Zenoh reads it, because Zenoh only says that a connection
did not come about.
"""

import os
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

from noctule.errors import TlsError

if TYPE_CHECKING:
    from cryptography.x509 import Certificate

FOLDER_VARIABLE = "NOCTULE_TLS"
AUTHORITY, CERTIFICATE, PRIVATE_KEY, CONFIG = "ca.pem", "certificate.pem", "private.key", "zenoh.json5"
ALARM = timedelta(days=30)
_NOT_ITS_OWNERS = 0o077


@dataclass(frozen=True)
class Identity:
    """What a sound folder shows. ``common_name`` is the certificate's: ``gateway.attic.g2``; times are UTC."""

    folder: Path
    common_name: str
    expires: datetime  # the certificate, or the authority where that is earlier

    @property
    def name(self) -> str | None:
        """The name within its role, ``attic``; None where the common name has another form."""
        match self.common_name.split("."):
            case [_role, name, _generation]:
                return name
        return None

    def expiry_alarm(self, now: datetime) -> str:
        """What to do about a certificate that expires within ALARM; empty where it is good for longer."""
        left = self.expires - now
        if left > ALARM:
            return ""
        when = f"expires on {self.expires:%Y-%m-%d}" if left > timedelta() else f"expired on {self.expires:%Y-%m-%d}"
        return f"the certificate of {self.common_name} {when}: {_renewal(self.common_name)}"


def chosen(folder: Path | None, now: datetime | None = None) -> Identity | None:
    """The identity of ``folder``, or of the one that NOCTULE_TLS names; None without either. Raises TlsError."""
    named = folder or (Path(value) if (value := os.environ.get(FOLDER_VARIABLE)) else None)
    return None if named is None else load(named, now or datetime.now(UTC))


def service_name(folder: Path | None, otherwise: str) -> str:
    """The name that a service shows itself by: that in its certificate, because no other is allowed to it.

    Raises TlsError.
    """
    identity = chosen(folder)
    return otherwise if identity is None or identity.name is None else identity.name


def load(folder: Path, now: datetime) -> Identity:
    """Check a folder. Raises TlsError: a file is missing, unreadable, does not fit the others, or is not valid now."""
    for name in (CONFIG, AUTHORITY, CERTIFICATE, PRIVATE_KEY):
        if not (folder / name).is_file():
            problem = (
                f"has no file {name}" if folder.is_dir() else "is no folder" if folder.exists() else "is not there"
            )
            raise TlsError(f"{folder} {problem}: give a folder that noctule-deploy render made, copied whole")
    authority, certificate = read_certificate(folder / AUTHORITY), read_certificate(folder / CERTIFICATE)
    check_private(folder / PRIVATE_KEY)
    _check_key(folder / PRIVATE_KEY, certificate)
    _check_issuer(folder, certificate, authority)
    common_name = common_name_of(certificate)
    for each, what in ((certificate, f"the certificate of {common_name}"), (authority, "the authority's certificate")):
        _check_times(folder, each, what, common_name, now)
    return Identity(folder, common_name, min(certificate.not_valid_after_utc, authority.not_valid_after_utc))


def read_certificate(path: Path) -> "Certificate":
    """A certificate of a PEM file. Raises TlsError."""
    from cryptography import x509  # programs without TLS do not wait for it

    try:
        return x509.load_pem_x509_certificate(path.read_bytes())
    except OSError as error:
        raise TlsError(f"{path} can't be read ({error.strerror}): is the program run by the folder's owner?") from error
    except ValueError as error:
        raise TlsError(f"{path} holds no certificate: copy it again") from error


def common_name_of(certificate: "Certificate") -> str:
    """The name that the routers' rules go by."""
    from cryptography.x509.oid import NameOID

    (attribute,) = certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    return str(attribute.value)


def check_private(path: Path) -> None:
    """Raises TlsError where others than its owner may read ``path``."""
    mode = path.stat().st_mode & 0o777
    if mode & _NOT_ITS_OWNERS:
        raise TlsError(f"others than its owner may read {path} (mode {mode:04o}): chmod 600 {path}")


def _check_key(path: Path, certificate: "Certificate") -> None:
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    try:
        key = load_pem_private_key(path.read_bytes(), password=None)
    except OSError as error:
        raise TlsError(f"{path} can't be read ({error.strerror}): run the program as the file's owner") from error
    except (ValueError, TypeError) as error:  # its text could hold a part of the key
        raise TlsError(f"{path} holds no private key that can be read: copy it again") from error
    if key.public_key() != certificate.public_key():
        raise TlsError(f"{path} does not belong to {CERTIFICATE} beside it: copy both from one folder")


def _check_issuer(folder: Path, certificate: "Certificate", authority: "Certificate") -> None:
    from cryptography.exceptions import InvalidSignature

    try:
        certificate.verify_directly_issued_by(authority)
    except (ValueError, TypeError, InvalidSignature) as error:
        stranger = f"{folder / CERTIFICATE} was not issued by the authority in {AUTHORITY} beside it"
        raise TlsError(f"{stranger}: copy both from one folder") from error


def _check_times(folder: Path, certificate: "Certificate", what: str, common_name: str, now: datetime) -> None:
    if now > certificate.not_valid_after_utc:
        ended = f"expired on {certificate.not_valid_after_utc:%Y-%m-%d}"
        raise TlsError(f"{folder}: {what} {ended}: {_renewal(common_name)}")
    if now < certificate.not_valid_before_utc:
        begins = f"is valid from {certificate.not_valid_before_utc:%Y-%m-%d %H:%M} UTC"
        raise TlsError(f"{folder}: {what} {begins}, and this host's clock says {now:%Y-%m-%d %H:%M}: set the clock")


def _renewal(common_name: str) -> str:
    subject = common_name.rpartition(".")[0] or common_name
    return f"run noctule-deploy renew {subject}, copy its new folder here, and start this program again"
