"""A compose file of a host's programs, for those who run containers: the command lines are those of the units."""

import json
from collections.abc import Iterable
from typing import Any

from noctule_deploy.fleet import ROUTER, Gateway
from noctule_deploy.hosts import WEB, Program, devices

_IMAGE = "noctule"  # deploy/container/Containerfile
_IMAGES = {ROUTER: "docker.io/eclipse/zenoh:1.10.2", WEB: "docker.io/library/caddy:2"}
_OWNER = "${NOCTULE_USER:?name the owner of these files: export NOCTULE_USER=$$(id -u):$$(id -g)}"
_HEAD = """\
# Made by noctule-deploy render. In this folder:
#   mkdir -p data && export NOCTULE_USER=$(id -u):$(id -g) && docker compose up --detach
"""


def compose(programs: Iterable[Program], gateways: Iterable[Gateway]) -> str:
    """The compose file of a host; JSON is YAML too. Its folder is the host's rendered folder."""
    serial = {each.name: devices(each) for each in gateways}
    services = {each.own.replace(".", "-"): _service(each, serial.get(each.name, [])) for each in programs}
    return _HEAD + json.dumps({"name": "noctule", "services": services}, indent=2) + "\n"


def _service(program: Program, serial: list[str]) -> dict[str, Any]:
    command = [word.replace("$", "$$") for word in program.command]
    service: dict[str, Any] = {
        "image": _IMAGES.get(program.role, _IMAGE),
        # The image of zenohd starts it by itself.
        "command": command[1:] if program.role == ROUTER else command,
        "user": _OWNER,
        "network_mode": "host",  # the relay stays on the host's loopback
        "restart": "always",
        "read_only": True,
        "tmpfs": ["/tmp"],
        "cap_drop": ["ALL"],
        "security_opt": ["no-new-privileges"],
        "volumes": ["./etc/noctule:/etc/noctule:ro", "./data:/var/lib/noctule"],
    }
    if program.role == WEB:
        # The image's program has the right to a port of root's by itself, which no-new-privileges would take from it.
        service |= {"cap_add": ["NET_BIND_SERVICE"], "security_opt": []}
        service["environment"] = {"XDG_DATA_HOME": f"/var/lib/noctule/{program.own}", "XDG_CONFIG_HOME": "/tmp"}
    if program.role == "mapper":
        service["init"] = True  # reaps what a killed process of a map leaves
    if program.role == "gateway" and serial:
        service["group_add"] = ["dialout"]
        service["devices"] = [f"{each}:{each}".replace("$", "$$") for each in serial]
    return service
