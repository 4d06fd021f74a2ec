"""The udev rules that name each unit's serial adapter: /dev/noctule/UNIT, in whatever socket it is."""

from collections.abc import Iterable
from pathlib import PurePosixPath

from noctule_deploy.fleet import Gateway
from noctule_deploy.fleet_rules import DEVICES

_HEAD = """\
# Made by noctule-deploy render. ID_SERIAL_SHORT comes from 60-serial.rules, so this file is read after that one:
#   udevadm info --name /dev/ttyUSB0 | grep ID_SERIAL_SHORT
"""


def rules(gateways: Iterable[Gateway]) -> str | None:
    """The rules for the adapters of a host's gateways; None where none is given."""
    adapters = [(unit, serial) for gateway in gateways for unit, serial in gateway.adapters.items()]
    if not adapters:
        return None
    folder = PurePosixPath(DEVICES).name
    return _HEAD + "".join(
        f'ACTION!="remove", SUBSYSTEM=="tty", ENV{{ID_SERIAL_SHORT}}=="{serial}", SYMLINK+="{folder}/{unit}", '
        f'GROUP="dialout", MODE="0660"\n'
        for unit, serial in adapters
    )
