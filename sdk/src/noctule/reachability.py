"""Why no router lets us in, found out by knocking: Zenoh itself only says that time has run out."""

import socket
import ssl
from collections.abc import Sequence
from dataclasses import dataclass

from noctule import endpoints, tls

_KNOCK_S = 1.0
_REFUSAL_S = 0.5  # TLS 1.3 refuses a client's certificate only after the handshake
_NOTHING_THERE = "start one, such as noctule-gateway run SITE.toml --data FOLDER, or name another endpoint"


def why_no_router(connect: Sequence[str], identity: tls.Identity | None) -> str:
    """What to tell an operator when no session comes about with any of the endpoints."""
    found = {endpoint: _knock(endpoint, identity) for endpoint in connect}
    if all(knock.reason == _NOTHING_THERE for knock in found.values()):
        return f"no router answers at {endpoints.shown(connect)}: {_NOTHING_THERE}"
    reasons = "; ".join(f"{endpoints.shown([endpoint])}: {knock.reason}" for endpoint, knock in found.items())
    refused = any(knock.answered for knock in found.values())
    return f"refused or unreachable: certificate? {reasons}" if refused else f"no router answers: {reasons}"


@dataclass(frozen=True)
class _Knock:
    """Why no session comes about at an endpoint; ``answered`` if something listens there."""

    reason: str
    answered: bool = False


def _knock(endpoint: str, identity: tls.Identity | None) -> _Knock:
    place = endpoints.host_and_port(endpoint)
    if place is None:
        return _Knock("no session comes about")
    try:
        with socket.create_connection(place, _KNOCK_S) as connection:
            secured = endpoints.protocol(endpoint) == "tls"
            return _Knock(_greet(connection, place[0], identity) if secured else _PLAIN, answered=True)
    except ConnectionRefusedError:
        return _Knock(_NOTHING_THERE)
    except (OSError, UnicodeError) as error:
        return _Knock(_why_unreachable(error, place[0]))


def unreachable(endpoint: str) -> str:
    """Why no connection to ``endpoint`` comes about; empty where one does, or where it is not one of TCP."""
    place = endpoints.host_and_port(endpoint)
    if place is None or endpoints.protocol(endpoint) not in ("tcp", "tls", "ws"):
        return ""
    try:
        socket.create_connection(place, _KNOCK_S).close()
    except ConnectionRefusedError:
        return "nothing listens there"
    except (OSError, UnicodeError) as error:
        return _why_unreachable(error, place[0])
    return ""


def _why_unreachable(error: OSError | UnicodeError, host: str) -> str:
    if isinstance(error, socket.gaierror | UnicodeError):
        return f"no host is known by the name {host}"
    return f"can't be reached ({error.strerror or 'no answer'})"


_PLAIN = "something listens, but takes no plain connection: if the router wants a certificate, give --tls FOLDER"


def _greet(connection: socket.socket, host: str, identity: tls.Identity | None) -> str:
    if identity is None:
        return "a certificate is needed: give --tls FOLDER, a folder that noctule-deploy render made"
    context = ssl.create_default_context(cafile=str(identity.folder / tls.AUTHORITY))
    context.load_cert_chain(identity.folder / tls.CERTIFICATE, identity.folder / tls.PRIVATE_KEY)
    try:
        with context.wrap_socket(connection, server_hostname=host) as secured:
            secured.settimeout(_REFUSAL_S)
            secured.recv(1)
    except ssl.SSLCertVerificationError as error:
        return f"the router's certificate is not one to trust ({error.verify_message}): is it of this fleet?"
    except ssl.SSLError as error:
        reason = (error.reason or "no reason given").lower().replace("_", " ")
        return f"the router refuses the certificate of {identity.common_name} ({reason}): is it of this fleet?"
    except TimeoutError:
        return "the router takes the certificate, and yet no session comes about: it may be full, see its log"
    except OSError as error:
        return f"the router hangs up ({error.strerror}): does it speak TLS?"
    return "the router hangs up: is it of this fleet?"
