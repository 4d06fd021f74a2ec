"""How a session is set up: Zenoh's configuration from endpoints, a folder of certificate and key, or a file."""

import json
import os
import re
from collections.abc import Sequence
from pathlib import Path

import zenoh

from noctule import endpoints, tls
from noctule.endpoints import DEFAULT_ROUTER
from noctule.errors import BusConfigError

CONFIG_VARIABLE = "ZENOH_CONFIG"

SIDES = ("connect", "listen")

_ATTEMPT_MS = 1000
_ENDPOINT_MS = 2000  # for an endpoint that takes the connection and says nothing
_SETTINGS = {
    "scouting/multicast/enabled": False,
    "scouting/gossip/enabled": False,
    "scouting/delay": 0,  # nothing is scouted, so nothing is to be waited for
    "transport/shared_memory/enabled": False,
    # An open session looks for its routers for ever, and often enough that an outage is soon over.
    # With any other timeout a client that opens tries its first endpoint alone until the time is up.
    "connect/timeout_ms": {"router": _ATTEMPT_MS, "peer": _ATTEMPT_MS, "client": 0},
    "transport/unicast/open_timeout": _ENDPOINT_MS,
    "connect/exit_on_failure": False,
    "connect/retry": {"period_init_ms": 200, "period_max_ms": 1000, "period_increase_factor": 2},
}
_WAIT_FOR_ADDRESSES = {
    "listen/exit_on_failure": False,
    "listen/timeout_ms": -1,
    "listen/retry": {"period_init_ms": 200, "period_max_ms": 1000, "period_increase_factor": 2},
}


def is_router(config: zenoh.Config) -> bool:
    """Whether a session of this configuration is a router itself."""
    return json.loads(config.get_json("mode")) == "router"


def config(
    connect: Sequence[str], listen: Sequence[str], identity: tls.Identity | None, lease_s: float | None = None
) -> zenoh.Config:
    """The configuration of a session, with its lease where one is given. Raises BusConfigError."""
    if faults := list(filter(None, map(endpoints.fault, (*connect, *listen)))):
        raise BusConfigError("; ".join(faults))
    made = _written_config(identity)
    settings = dict(_SETTINGS)
    if identity is None or connect or listen:
        settings |= {
            "mode": "router" if listen else "client",
            "connect/endpoints": list(connect if connect or listen else [DEFAULT_ROUTER]),
            "listen/endpoints": list(listen),
        }
    if identity is not None:
        settings |= {f"transport/link/tls/{key}": str(path) for key, path in _files(identity, made).items()}
    if lease_s is not None:
        settings["transport/link/tx/lease"] = round(1e3 * lease_s)
    for key, value in settings.items():
        _set(made, key, value)
    if identity is not None:
        _check_secured(made, identity)
    return made


def wait_for_addresses(config: zenoh.Config) -> None:
    """Have a router begin without the addresses that its host does not have yet, and try them again by and by."""
    for key, value in _WAIT_FOR_ADDRESSES.items():
        config.insert_json5(key, json.dumps(value))


def _written_config(identity: tls.Identity | None) -> zenoh.Config:
    """The configuration file that the folder of certificates has, else the one that the variable names, else none."""
    if identity is not None:
        return _read_config(identity.folder / tls.CONFIG, f"the folder of {identity.common_name} has")
    if path := os.environ.get(CONFIG_VARIABLE):
        return _read_config(Path(path), f"{CONFIG_VARIABLE} names")
    return zenoh.Config()


def _set(made: zenoh.Config, key: str, value: object) -> None:
    try:
        made.insert_json5(key, json.dumps(value))
    except zenoh.ZError as error:
        written = endpoints.shown(value) if isinstance(value, list) else value
        raise BusConfigError(f"{key} can't be {written}: write an endpoint as tcp/HOST:PORT") from error


def _read_config(path: Path, whose: str) -> zenoh.Config:
    try:
        return zenoh.Config.from_file(str(path))
    except zenoh.ZError as error:
        # Zenoh shows the line, which may hold a password; its place is enough, in a traceback too.
        line = re.search(r"--> (\d+):|line: (\d+)", str(error))
        place = f", line {line[1] or line[2]}" if line else ""
        problem = "has an error" if path.is_file() else "is not there"
        raise BusConfigError(f"the Zenoh configuration {path}{place}, which {whose}, {problem}: correct it") from None


def _files(identity: tls.Identity, config: zenoh.Config) -> dict[str, Path]:
    """The folder's files where its configuration names some: that has the paths of the host that it was made for."""
    folder, named = identity.folder, json.loads(config.get_json("transport/link/tls"))
    files = {"root_ca_certificate": folder / tls.AUTHORITY}
    for side in SIDES:
        files |= {f"{side}_certificate": folder / tls.CERTIFICATE, f"{side}_private_key": folder / tls.PRIVATE_KEY}
    return {key: path for key, path in files.items() if named[key]}


def _check_secured(config: zenoh.Config, identity: tls.Identity) -> None:
    certified = json.loads(config.get_json("transport/link/tls"))
    if endpoints_of(config, "listen") and not certified["listen_certificate"]:
        raise BusConfigError(
            f"{identity.common_name} is a client's and not a router's, so no program can listen with it: leave "
            "--listen out, or give the folder of a router"
        )
    for side in SIDES:
        for endpoint in endpoints_of(config, side):
            if not _is_secured(config, endpoint):
                shown = endpoints.shown([endpoint])
                raise BusConfigError(
                    f"{shown} would not use the certificate of {identity.common_name}: write tls/HOST:PORT"
                )


def _is_secured(config: zenoh.Config, endpoint: str) -> bool:
    mutual = json.loads(config.get_json("transport/link/tls/enable_mtls"))
    return endpoints.protocol(endpoint) in ("tls", "quic") and mutual is True


def open_to_all(config: zenoh.Config) -> str:
    """That a session listens beyond loopback for anybody, with or without a certificate; "" where it does not."""
    found = [
        each
        for each in endpoints_of(config, "listen")
        if not endpoints.is_loopback(each) and not _is_secured(config, each)
    ]
    if not found:
        return ""
    return (
        f"anybody who reaches {endpoints.shown(found)} can command the units and forge their sweeps: listen on "
        "loopback, or give --tls FOLDER"
    )


def is_local(connect: Sequence[str], listen: Sequence[str], tls_folder: Path | None) -> bool:
    """Whether a session is the router of its bus and listens on loopback only, without TLS: so nobody beyond this host
    is on it. Where else another router listens can't be seen. Raises BusConfigError, TlsError.
    """
    identity = tls.chosen(tls_folder)
    made = config(connect, listen, identity)
    places = [each for side in SIDES for each in endpoints_of(made, side)]
    return identity is None and is_router(made) and all(map(endpoints.is_loopback, places))


def endpoints_of(config: zenoh.Config, side: str) -> list[str]:
    """The endpoints that a session is to ``connect`` to, or to ``listen`` on."""
    named = json.loads(config.get_json(f"{side}/endpoints"))
    return named.get(json.loads(config.get_json("mode")), []) if isinstance(named, dict) else named  # Zenoh's default
