"""Which programs run on which host, each with its command line. All paths are the host's."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from noctule import keys, rerun_paths, tls
from noctule import site as site_files
from noctule_deploy.fleet import ROUTER, Fleet, Gateway, Mapper, Router, Viewer

BIN = PurePosixPath("/opt/noctule/bin")
SITES = PurePosixPath("/etc/noctule/sites")
CADDYFILE = PurePosixPath("/etc/noctule/Caddyfile")
STATE = PurePosixPath("/var/lib/noctule")
WEB = "web"


@dataclass(frozen=True)
class Program:
    """A program of ``host``: ``subject`` is the name of its certificate, but for the generation; None without one."""

    role: str
    name: str
    host: str
    subject: str | None
    command: tuple[str, ...]

    @property
    def own(self) -> str:
        """Its name among all programs of the fleet: ``gateway.attic``."""
        return f"{self.role}.{self.name}"

    @property
    def service(self) -> str:
        """The name of its systemd unit."""
        return f"noctule-{self.role}-{self.name}.service"

    @property
    def user(self) -> str:
        """The system user that it runs as."""
        return f"noctule-{self.role}"


def programs(fleet: Fleet) -> Iterator[Program]:
    """All that have a host, in the order in which they are started."""
    for router in fleet.router:
        if router.host:
            yield Program(ROUTER, router.name, router.host, f"{ROUTER}.{router.name}", _router(fleet, router))
    for gateway in fleet.gateway:
        if gateway.host:
            subject = f"{ROUTER}.{gateway.router}" if gateway.router else f"gateway.{gateway.name}"
            yield Program("gateway", gateway.name, gateway.host, subject, _gateway(fleet, gateway, subject))
    for viewer in fleet.viewer:
        if viewer.host:
            yield Program("viewer", viewer.name, viewer.host, f"viewer.{viewer.name}", _viewer(fleet, viewer))
    for mapper in fleet.mapper:
        if mapper.host:
            yield Program("mapper", mapper.name, mapper.host, f"mapper.{mapper.name}", _mapper(fleet, mapper))
    for viewer in fleet.viewer:
        if viewer.host and viewer.web:
            command = ("/usr/bin/caddy", "run", "--adapter", "caddyfile", "--config", str(CADDYFILE))
            yield Program(WEB, viewer.name, viewer.host, None, command)


def certificate_folder(fleet: Fleet, subject: str) -> PurePosixPath:
    """Where its host keeps the folder of a certificate: a host with several programs has one for each."""
    folder = PurePosixPath(fleet.folder)
    return folder / subject if any(each.subject == subject for each in programs(fleet)) else folder


def site_file(gateway: Gateway) -> PurePosixPath:
    """Where its host keeps the site file of a gateway."""
    return SITES / f"{gateway.name}.toml"


def devices(gateway: Gateway) -> list[str]:
    """The devices of the gateway's host at which its units are, as its site file names them."""
    units = site_files.load(Path(gateway.site_file)).units if gateway.site_file else ()
    return [each.address for each in units if each.address.startswith("/dev/")]


def sites_of(fleet: Fleet, watcher: Mapper | Viewer) -> list[str]:
    """The sites that a mapper or a viewer is for, by name."""
    return fleet.sites() if keys.ANY in watcher.sites else list(dict.fromkeys(watcher.sites))


def shows(fleet: Fleet, viewer: Viewer, mapper: Mapper) -> bool:
    """Whether those who watch the viewer may see all maps of the mapper."""
    return set(sites_of(fleet, mapper)) <= set(sites_of(fleet, viewer))


def _router(fleet: Fleet, router: Router) -> tuple[str, ...]:
    return "/usr/bin/zenohd", "--config", str(_folder(fleet, f"{ROUTER}.{router.name}") / tls.CONFIG)


def _gateway(fleet: Fleet, gateway: Gateway, subject: str) -> tuple[str, ...]:
    run = (str(BIN / "noctule-gateway"), "run", str(site_file(gateway)))
    return *run, *_data_and_tls(fleet, f"gateway.{gateway.name}", subject), *gateway.options


def _mapper(fleet: Fleet, mapper: Mapper) -> tuple[str, ...]:
    sites = sites_of(fleet, mapper)
    relays = [each for each in fleet.viewer if each.host == mapper.host and shows(fleet, each, mapper)]
    rerun = _relay(fleet, relays[0]) if relays else "none"
    run = (str(BIN / "noctule-mapper"), "run" if len(sites) == 1 else "share", *_named(sites))
    subject = f"mapper.{mapper.name}"
    return *run, *_data_and_tls(fleet, subject, subject), "--rerun", rerun, *mapper.options


def _viewer(fleet: Fleet, viewer: Viewer) -> tuple[str, ...]:
    ports = ("--port", str(viewer.port), "--web-port", str(viewer.web_port), "--memory-limit", viewer.memory_limit)
    bus = (*_named(sites_of(fleet, viewer)), "--tls", str(_folder(fleet, f"viewer.{viewer.name}")))
    return str(BIN / "noctule-viewer"), "run", *ports, *bus, *viewer.options


def _relay(fleet: Fleet, viewer: Viewer) -> str:
    """Where mappers of the viewer's host draw."""
    several = rerun_paths.SEVERAL_SITES if len(sites_of(fleet, viewer)) > 1 else ""
    return f"rerun+http://127.0.0.1:{viewer.port}/proxy{several}"


def _named(sites: Sequence[str]) -> list[str]:
    return [word for site in sites for word in ("--site", site)]


def _data_and_tls(fleet: Fleet, own: str, subject: str) -> tuple[str, ...]:
    return "--data", str(STATE / own), "--tls", str(_folder(fleet, subject))


def _folder(fleet: Fleet, subject: str) -> PurePosixPath:
    return PurePosixPath(fleet.folder) / subject
