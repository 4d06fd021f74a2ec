"""The fleet's certificate authority, and the certificates that it issues: EC P-256, for servers and clients alike."""

import ipaddress
import secrets
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from noctule.tls import read_certificate
from noctule_deploy.errors import RenderError
from noctule_deploy.files import make_private_folder, write_atomically, write_new_key

KEY_FILE, CERTIFICATE_FILE = "ca.key", "ca.pem"
VALID = timedelta(days=20 * 365)
_SLACK = timedelta(hours=1)  # by which a host's clock may be behind
_NAME = "Noctule fleet authority"

PrivateKey = ec.EllipticCurvePrivateKey


@dataclass(frozen=True)
class Authority:
    """An authority in its folder; its key is read only when it issues something."""

    folder: Path
    certificate: x509.Certificate

    def issue(
        self, common_name: str, addresses: Iterable[str], key: PrivateKey, now: datetime, valid: timedelta
    ) -> x509.Certificate:
        """A certificate of ``key`` for a name, and for the addresses at which others reach it. Raises RenderError."""
        ends = min(now + valid, self.certificate.not_valid_after_utc)
        return (
            _builder(common_name, self.certificate.subject, key, now, ends)
            .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
            .add_extension(_usage(signs_certificates=False), critical=True)
            .add_extension(
                x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]),
                critical=False,
            )
            .add_extension(alternative_names(common_name, addresses), critical=False)
            .add_extension(
                x509.AuthorityKeyIdentifier.from_issuer_public_key(_ec(self.certificate.public_key())), critical=False
            )
            .sign(_read_key(self.folder / KEY_FILE), hashes.SHA256())
        )


def open_or_create(folder: Path, now: datetime) -> Authority:
    """The authority of ``folder``, made where there is none yet. Raises RenderError, TlsError."""
    if not (folder / CERTIFICATE_FILE).exists():
        make_private_folder(folder)
        key = ensure_key(folder / KEY_FILE)
        write_atomically(folder / CERTIFICATE_FILE, pem(_self_signed(key, now)))
    return Authority(folder, read_certificate(folder / CERTIFICATE_FILE))


def ensure_key(path: Path) -> PrivateKey:
    """The key of a file, made where there is none; one that is there is never replaced. Raises RenderError."""
    if path.exists():
        return _read_key(path)
    key = ec.generate_private_key(ec.SECP256R1())
    content = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    write_new_key(path, content)
    return key


def alternative_names(common_name: str, addresses: Iterable[str]) -> x509.SubjectAlternativeName:
    """The names that a certificate is good for."""
    return x509.SubjectAlternativeName([x509.DNSName(common_name), *map(_general_name, addresses)])


def pem(certificate: x509.Certificate) -> bytes:
    """The certificate as it stands in a file."""
    return certificate.public_bytes(serialization.Encoding.PEM)


def _self_signed(key: PrivateKey, now: datetime) -> x509.Certificate:
    # With two authorities of one name a router calls a stranger's certificate a broken signature.
    name = f"{_NAME} {secrets.token_hex(4)}"
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
    return (
        _builder(name, subject, key, now, now + VALID)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(_usage(signs_certificates=True), critical=True)
        .sign(key, hashes.SHA256())
    )


def _builder(
    common_name: str, issuer: x509.Name, key: PrivateKey, begins: datetime, ends: datetime
) -> x509.CertificateBuilder:
    return (
        x509.CertificateBuilder()
        .subject_name(x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common_name)]))
        .issuer_name(issuer)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(begins - _SLACK)
        .not_valid_after(ends)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
    )


def _usage(signs_certificates: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not signs_certificates,
        key_cert_sign=signs_certificates,
        crl_sign=signs_certificates,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        encipher_only=False,
        decipher_only=False,
    )


def _read_key(path: Path) -> PrivateKey:
    try:
        key = serialization.load_pem_private_key(path.read_bytes(), password=None)
    except OSError as error:
        raise RenderError(f"{path} can't be read ({error.strerror}): bring it here, or name its folder") from error
    except (ValueError, TypeError) as error:
        raise RenderError(f"{path} holds no private key: bring it back from your backup") from error
    if not isinstance(key, ec.EllipticCurvePrivateKey):
        raise RenderError(f"{path} is a key of another kind: noctule-deploy makes EC P-256")
    return key


def _ec(key: object) -> ec.EllipticCurvePublicKey:
    if not isinstance(key, ec.EllipticCurvePublicKey):
        raise RenderError("the authority has a key of another kind: noctule-deploy makes EC P-256")
    return key


def _general_name(address: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(address))
    except ValueError:
        return x509.DNSName(address)
