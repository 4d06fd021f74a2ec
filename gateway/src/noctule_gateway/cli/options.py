"""The options that several commands have."""

from pathlib import Path
from typing import Annotated

import typer

from noctule import firmware_rules, logs, tls

DEFAULT_LISTEN = "tcp/127.0.0.1:7447"

FirmwareFile = Annotated[
    Path | None,
    typer.Option(
        "--firmware",
        metavar="FIRMWARE.toml",
        help=f"The keys that images are to be signed with; {firmware_rules.FILE} of the --tls folder if left out.",
    ),
]
TlsFolder = Annotated[
    Path | None,
    typer.Option(
        "--tls",
        envvar=tls.FOLDER_VARIABLE,
        metavar="FOLDER",
        help="Certificate and key: a folder that noctule-deploy made. It also names the routers.",
    ),
]
Format = Annotated[logs.LogFormat, typer.Option(envvar=logs.FORMAT_VARIABLE, help="The log as text, or as JSON lines.")]
