"""The command ``noctule-gateway``."""

import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer
import zenoh
from rich.console import Console

from noctule import bus, bus_config, firmware_rules, logs, metrics, metrics_server, site, tls
from noctule.backup import copy_databases, whole_or_nothing
from noctule.bus_watch import BusWatch
from noctule.ending import Ending
from noctule.errors import NoctuleError
from noctule.logs import LogFormat
from noctule.progress import progress
from noctule.systemd import ServiceManager
from noctule.threads import end_process_when_one_fails
from noctule.version_option import version_option
from noctule_gateway.audit.look import AuditLook, copy_audit, look_at_audit
from noctule_gateway.limits import allow_files
from noctule_gateway.log.log_file import Retention
from noctule_gateway.log.look import Look, look_at_all
from noctule_gateway.log.repair import repair as repair_logs
from noctule_gateway.router import serve as serve_router
from noctule_gateway.service import Gateway
from noctule_gateway.update.admission import Admission
from noctule_gateway.update.report import Bars, report
from noctule_gateway.update.site import update_units

DEFAULT_LISTEN = "tcp/127.0.0.1:7447"
_REPORT_EVERY_S = 1.0

_log = logging.getLogger(__name__)
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

app = typer.Typer(no_args_is_help=True, pretty_exceptions_enable=False)


@app.callback()
def main(_version: Annotated[bool, version_option("noctule-gateway")] = False) -> None:
    """Serial scanner units to Zenoh."""


@app.command()
def run(
    site_file: Annotated[Path, typer.Argument(metavar="SITE.toml", help="The site whose units to serve.")],
    data: Annotated[Path, typer.Option(help="Folder of the units' logs; made if it is not there.")],
    connect: Annotated[list[str] | None, typer.Option(help="A router of the bus; give more for a fallback.")] = None,
    listen: Annotated[
        list[str] | None,
        typer.Option(help=f"Be the router, at this endpoint; {DEFAULT_LISTEN} without --connect and --tls."),
    ] = None,
    tls_folder: TlsFolder = None,
    firmware: FirmwareFile = None,
    name: Annotated[
        str | None,
        typer.Option(help="Its name among the site's services; its certificate's, or 'gateway', if left out."),
    ] = None,
    keep_mb: Annotated[float, typer.Option(min=1, help="Size of each unit's log, in MB of sweeps.")] = 256,
    keep_days: Annotated[float, typer.Option(min=0, help="Age at which sweeps leave the log.")] = 30,
    metrics_at: Annotated[
        str | None, typer.Option("--metrics", metavar="HOST:PORT", help="Serve Prometheus metrics here.")
    ] = None,
    log_format: Annotated[
        LogFormat, typer.Option(envvar=logs.FORMAT_VARIABLE, help="The log as text, or as JSON lines.")
    ] = LogFormat.TEXT,
) -> None:
    """Serve the units of a site until SIGTERM or Ctrl-C."""
    logs.set_up(log_format)
    zenoh.init_log_from_env_or("error")
    end_process_when_one_fails()
    ending = Ending()
    retention = Retention(max_bytes=round(keep_mb * 1e6), max_age_s=keep_days * 86400)
    try:
        default = [] if connect or tls_folder else [DEFAULT_LISTEN]
        access = _Access(connect or [], listen or default, tls_folder, firmware, metrics_at)
        _serve(site_file, data, name or tls.service_name(tls_folder, "gateway"), retention, access, ending)
    except (NoctuleError, OSError) as error:
        logs.log_lines(_log, error)
        raise typer.Exit(1) from error


@app.command()
def router(
    listen: Annotated[
        list[str] | None, typer.Option(help=f"Where; {DEFAULT_LISTEN} without --tls, else as its folder says.")
    ] = None,
    connect: Annotated[list[str] | None, typer.Option(help="Another router to link with.")] = None,
    tls_folder: TlsFolder = None,
    log_format: Annotated[
        LogFormat, typer.Option(envvar=logs.FORMAT_VARIABLE, help="The log as text, or as JSON lines.")
    ] = LogFormat.TEXT,
) -> None:
    """Be the router alone, for gateways with --connect, until SIGTERM or Ctrl-C."""
    logs.set_up(log_format)
    zenoh.init_log_from_env_or("error")
    end_process_when_one_fails()
    ending = Ending()
    try:
        serve_router(listen or ([] if tls.chosen(tls_folder) else [DEFAULT_LISTEN]), connect or [], tls_folder, ending)
    except (NoctuleError, OSError) as error:
        _log.error("%s", error)
        raise typer.Exit(1) from error


@app.command()
def update(
    site_file: Annotated[Path, typer.Argument(metavar="SITE.toml", help="The site whose units to update.")],
    image_file: Annotated[Path, typer.Option("--image", help="build/update.hex of the firmware.")],
    unit: Annotated[list[str] | None, typer.Option(help="Only this unit; give more for several.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Update units that have this version, too.")] = False,
    tls_folder: TlsFolder = None,
    firmware: FirmwareFile = None,
) -> None:
    """Update the firmware of a site's units, over their lines: stop the gateway that holds these first."""
    end_process_when_one_fails()
    console = Console()
    try:
        known = site.load(site_file)
        has_no_bus = tls.chosen(tls_folder) is None
        image = Admission(firmware_rules.chosen(firmware, tls_folder), takes_unsigned=has_no_bus).load(image_file)
        console.print(f"{image_file} {image.version_text}: {image.signer}")
        units = [known.unit(name) for name in dict.fromkeys(unit)] if unit else known.units
        with Bars(console) as bars:
            updates = update_units(units, image, force, bars.show)
    except (NoctuleError, OSError) as error:
        Console(stderr=True).print(str(error), style="red", soft_wrap=True, markup=False)
        raise typer.Exit(1) from error
    except KeyboardInterrupt as stop:
        console.print("stopped: units that were under way go on where they were when they are updated again")
        raise typer.Exit(130) from stop
    if not report(console, updates, image):
        raise typer.Exit(1)


@app.command()
def repair(
    data: Annotated[Path, typer.Argument(metavar="DATA", help="The data folder of a gateway that is stopped.")],
    unit: Annotated[
        list[str] | None, typer.Option(help="Set this unit's log aside, damaged or not; give more for several.")
    ] = None,
) -> None:
    """Set damaged logs aside, whole, into DATA/set-aside; the gateway then begins new ones."""
    try:
        repairs = repair_logs(data, list(dict.fromkeys(unit or [])))
    except NoctuleError as error:
        Console(stderr=True).print(str(error), style="red", soft_wrap=True, markup=False)
        raise typer.Exit(1) from error
    for each in repairs:
        typer.echo(str(each))
    if not repairs:
        typer.echo(f"{data} holds no logs")


@app.command()
def check(
    data: Annotated[Path, typer.Argument(metavar="DATA", help="The data folder of a gateway, which may be running.")],
) -> None:
    """Read every record of every log and say what was damaged or altered; exit status 1 if so. Changes nothing."""
    try:
        with progress() as shown:
            looks = [*look_at_all(data, shown.at), *look_at_audit(data)]
        _tell(looks)
    except NoctuleError as error:
        Console(stderr=True).print(str(error), style="red", soft_wrap=True, markup=False)
        raise typer.Exit(1) from error


@app.command()
def backup(
    data: Annotated[Path, typer.Argument(metavar="DATA", help="The data folder of a gateway, which may be running.")],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The folder of the copy; it must not be there yet.")],
) -> None:
    """Copy every log into OUT, each as it is at one moment, and check the copies; exit status 1 if one is damaged."""
    try:
        with whole_or_nothing(out), progress() as shown:
            copy_databases(data, out, shown.at)
            copy_audit(data, out)
            looks = [*look_at_all(out, shown.at), *look_at_audit(out)]
        _tell(looks)
    except NoctuleError as error:
        Console(stderr=True).print(str(error), style="red", soft_wrap=True, markup=False)
        raise typer.Exit(1) from error


def _tell(looks: list[Look | AuditLook]) -> None:
    for each in looks:
        typer.echo(str(each))
    if any(each.trouble for each in looks):
        raise typer.Exit(1)


@dataclass(frozen=True)
class _Access:
    """How the gateway joins the bus, and where it shows its metrics."""

    connect: list[str]
    listen: list[str]
    tls_folder: Path | None
    firmware: Path | None
    metrics_at: str | None


def _admission(access: _Access) -> Admission:
    is_local = bus_config.is_local(access.connect, access.listen, access.tls_folder)
    admission = Admission(firmware_rules.chosen(access.firmware, access.tls_folder), takes_unsigned=is_local)
    _log.log(logging.INFO if admission.rules or is_local else logging.WARNING, "firmware: %s", admission)
    return admission


def _serve(site_file: Path, data: Path, name: str, retention: Retention, access: _Access, ending: Ending) -> None:
    served = site.load(site_file)
    if warning := allow_files(len(served.units)):
        _log.warning("%s", warning)
    gateway = Gateway(served, data, name, retention, admission=_admission(access))
    manager = ServiceManager()
    session: zenoh.Session | None = None

    def look_after() -> None:
        if ending.begun.is_set():
            raise KeyboardInterrupt
        gateway.report()
        manager.serving(gateway.summary, gateway.makes_progress)

    try:
        with metrics_server.serving(access.metrics_at, metrics.registry(gateway.statuses)):
            gateway.start()
            session = bus.open_session(
                access.connect, access.listen, tls_folder=access.tls_folder, while_waiting=look_after
            )
            watch = BusWatch(session, access.connect, access.listen, access.tls_folder)
            gateway.join(session, watch, access.tls_folder)
            where = access.listen or access.connect or [f"as {access.tls_folder} says"]
            _log.info("on the bus: %s", f"the router at {', '.join(where)}" if access.listen else ", ".join(where))
            while True:
                look_after()
                ending.begun.wait(_REPORT_EVERY_S)
    except KeyboardInterrupt:
        _log.info("stopping")
    finally:
        ending.begin()
        manager.stopping()
        gateway.close()
        if session is not None:
            session.close()
