"""A router of the bench: ``python -m bench.scale.router LISTEN [OTHER]``; zenohd where it is installed or
NOCTULE_ZENOHD names it.
"""

import os
import shutil
import sys
import threading

from noctule import bus


def main(listen: str, *others: str) -> None:
    """Route until killed."""
    if zenohd := os.environ.get("NOCTULE_ZENOHD") or shutil.which("zenohd"):
        linked = [argument for other in others for argument in ("--connect", other)]
        os.execv(zenohd, [zenohd, "--no-multicast-scouting", "--listen", listen, *linked])
    with bus.open_session(connect=others, listen=[listen]):
        threading.Event().wait()


if __name__ == "__main__":
    main(*sys.argv[1:])
