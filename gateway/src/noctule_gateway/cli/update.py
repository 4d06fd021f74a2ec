"""The command ``update``: new firmware for a site's units, over their lines."""

from pathlib import Path
from typing import Annotated

import typer

from noctule import tls
from noctule.program_options import Tls
from noctule_gateway.cli.failing import failing_in_words
from noctule_gateway.cli.options import FirmwareFile


def update(
    site_file: Annotated[Path, typer.Argument(metavar="SITE.toml", help="The site whose units to update.")],
    image_file: Annotated[Path, typer.Option("--image", help="build/update.hex of the firmware.")],
    unit: Annotated[
        list[str] | None, typer.Option(metavar="UNIT", help="Only this unit; give more for several.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Update units that have this version, too.")] = False,
    tls_folder: Tls = None,
    firmware: FirmwareFile = None,
) -> None:
    """Update the firmware of a site's units, over their lines: stop the gateway that holds these first."""
    from rich.console import Console

    from noctule import firmware_rules, site
    from noctule.threads import end_process_when_one_fails
    from noctule_gateway.update.admission import Admission
    from noctule_gateway.update.report import Bars, report
    from noctule_gateway.update.site import update_units

    end_process_when_one_fails()
    console = Console()
    try:
        with failing_in_words():
            known = site.load(site_file)
            has_no_bus = tls.chosen(tls_folder) is None
            image = Admission(firmware_rules.chosen(firmware, tls_folder), takes_unsigned=has_no_bus).load(image_file)
            console.print(f"{image_file} {image.version_text}: {image.signer}")
            units = [known.unit(name) for name in dict.fromkeys(unit)] if unit else known.units
            with Bars(console) as bars:
                updates = update_units(units, image, force, bars.show)
    except KeyboardInterrupt as stop:
        console.print("stopped: units that were under way go on where they were when they are updated again")
        raise typer.Exit(130) from stop
    if not report(console, updates, image):
        raise typer.Exit(1)
