"""The options that several commands have."""

from pathlib import Path
from typing import Annotated

import typer

from noctule import firmware_rules

DEFAULT_LISTEN = "tcp/127.0.0.1:7447"

FirmwareFile = Annotated[
    Path | None,
    typer.Option(
        "--firmware",
        metavar="FIRMWARE.toml",
        help=f"The keys that images are to be signed with; {firmware_rules.FILE} of the --tls folder if left out.",
    ),
]
