"""Run the demo: simulated unit with its real firmware, gateway, mapper and viewer, all on this machine's loopback.

The processes stand in the Procfile beside this file. The environment may change what SETTINGS names.
"""

import os
import shutil
import socket
import sys
from pathlib import Path

from noctule_viewer.relay import Relay

HERE = Path(__file__).parent
SETTINGS = {
    "DEMO_SPEED": "12",  # simulated seconds per second: the walk around the room takes some 8 minutes
    "DEMO_SEED": "1",
    "DEMO_UNIT_PORT": "7101",
    "DEMO_ZENOH_PORT": "7447",
    "DEMO_RERUN_PORT": "9876",
    "DEMO_WEB_PORT": "9090",
    "DEMO_DATA": ".demo",
}


def main() -> None:
    settings = {name: os.environ.get(name, default) for name, default in SETTINGS.items()}
    for name, value in settings.items():
        if name.endswith("_PORT"):
            require_free(name, int(value))
    write_site(Path(settings["DEMO_DATA"]), settings["DEMO_UNIT_PORT"])
    relay = Relay("127.0.0.1", int(settings["DEMO_RERUN_PORT"]), int(settings["DEMO_WEB_PORT"]), memory_limit="512MB")
    print(f"Open {relay.page} and watch the room being mapped; Ctrl-C ends the demo.", flush=True)
    commands = Path(sys.executable).parent
    path = f"{commands}{os.pathsep}{os.environ['PATH']}"
    honcho = [str(commands / "honcho"), "start", "--procfile", str(HERE / "Procfile"), "--app-root", str(Path.cwd())]
    os.execve(honcho[0], honcho, os.environ | settings | {"PATH": path, "PYTHONUNBUFFERED": "1"})


def require_free(name: str, port: int) -> None:
    """Exit with one line if something listens on the port already."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            message = (
                f"Port {port} is in use: end what listens there (another demo?), or choose another with {name}=..."
            )
            raise SystemExit(message) from None


def write_site(data: Path, unit_port: str) -> None:
    """Begin with a data folder that holds nothing but the site file, its unit at the chosen port."""
    if data.exists():
        if any(data.iterdir()) and not (data / "site.toml").exists():
            raise SystemExit(
                f"{data} holds something else than an earlier demo: choose another folder with DEMO_DATA=..."
            )
        shutil.rmtree(data)
    data.mkdir(parents=True)
    site = (HERE / "site.toml").read_text()
    (data / "site.toml").write_text(site.replace("socket://127.0.0.1:7101", f"socket://127.0.0.1:{unit_port}"))


if __name__ == "__main__":
    main()
