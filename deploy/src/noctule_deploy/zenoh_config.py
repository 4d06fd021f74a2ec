"""The Zenoh configurations of routers and clients, as plain data. Every file name in them is the host's."""

from collections.abc import Iterable, Sequence
from pathlib import PurePosixPath
from typing import Any

from noctule import tls
from noctule_deploy.fleet import ROUTER, Fleet, Router, bracketed
from noctule_deploy.generations import Generations
from noctule_deploy.roles import Rule, rules_of, rules_of_routers

_MAX_SESSIONS = 20_000  # Zenoh's own limit of 1,000 is met without a word
_ACCEPT_PENDING = 1_000
_FOR_EVER = {"timeout_ms": -1, "exit_on_failure": False}
_RETRY = {"period_init_ms": 200, "period_max_ms": 1000, "period_increase_factor": 2}


def client(fleet: Fleet, folder: PurePosixPath) -> dict[str, Any]:
    """The configuration of a client: every router is one to fall back on. ``folder`` is where its host keeps it."""
    endpoints = [endpoint(router) for router in fleet.router]
    sides = {"connect": _connect(endpoints), "listen": {"endpoints": []}}
    return {"mode": "client"} | sides | _common(folder, {"protocols": ["tls"]}, listens=False)


def router(fleet: Fleet, own: Router, generations: dict[str, Generations], folder: PurePosixPath) -> dict[str, Any]:
    """The configuration of a router, which opens a link to each router above it in the fleet file."""
    above = fleet.router[: fleet.router.index(own)]
    common = _common(folder, {"protocols": ["tls"]}, listens=True)
    common["transport"]["unicast"] = {"max_sessions": _MAX_SESSIONS, "accept_pending": _ACCEPT_PENDING}
    return {
        "mode": "router",
        "listen": {"endpoints": [f"tls/{bracketed(own.listen)}:{own.port}"]},
        "connect": _connect([endpoint(each) for each in above]),
        "access_control": access_control(fleet, generations),
    } | common


def endpoint(router: Router) -> str:
    """Where others reach a router."""
    return f"tls/{bracketed(router.address)}:{router.port}"


def access_control(fleet: Fleet, generations: dict[str, Generations]) -> dict[str, Any]:
    """Who may do what; the same for all routers. What no rule allows is denied."""
    routers = [
        name for each in fleet.router for name in generations[f"{ROUTER}.{each.name}"].admitted(f"{ROUTER}.{each.name}")
    ]
    holders: list[tuple[str, list[str], Sequence[Rule]]] = [
        ("routers", routers, rules_of_routers()),
        *(
            (member.subject, generations[member.subject].admitted(member.subject), rules_of(member))
            for member in fleet.members()
        ),
    ]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [rule for subject, _, rules in holders for rule in _rules(subject, rules)],
        "subjects": [{"id": subject, "cert_common_names": names} for subject, names, _ in holders],
        "policies": [
            {"rules": [each["id"] for each in _rules(subject, rules)], "subjects": [subject]}
            for subject, _, rules in holders
        ],
    }


def _rules(subject: str, rules: Iterable[Rule]) -> list[dict[str, Any]]:
    return [
        {
            "id": f"{subject}/{number}",
            "permission": "allow",
            "flows": [rule.flow],
            "messages": list(rule.messages),
            "key_exprs": list(rule.key_exprs),
        }
        for number, rule in enumerate(rules, start=1)
    ]


def _common(folder: PurePosixPath, link: dict[str, Any], listens: bool) -> dict[str, Any]:
    certificate, key = str(folder / tls.CERTIFICATE), str(folder / tls.PRIVATE_KEY)
    files: dict[str, Any] = {
        "root_ca_certificate": str(folder / tls.AUTHORITY),
        "enable_mtls": True,
        "verify_name_on_connect": True,
        "close_link_on_expiration": True,
        "connect_certificate": certificate,
        "connect_private_key": key,
    }
    if listens:
        files |= {"listen_certificate": certificate, "listen_private_key": key}
    return {
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {"link": link | {"tls": files}, "shared_memory": {"enabled": False}},
    }


def _connect(endpoints: list[str]) -> dict[str, Any]:
    return {"endpoints": endpoints, **_FOR_EVER, "retry": _RETRY}
