"""Everything that one host gets: a tree that is laid out as on the host, and the script that installs it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path, PurePosixPath
from string import Template

from noctule_deploy import udev, units
from noctule_deploy.caddy import caddyfile
from noctule_deploy.compose import compose
from noctule_deploy.fleet import ROUTER, Fleet
from noctule_deploy.hosts import CADDYFILE, WEB, Program, certificate_folder, devices, programs, site_file

_PACKAGES = {"gateway": "noctule_gateway", "mapper": "noctule_mapper", "viewer": "noctule_viewer"}
_NEEDS = {
    ROUTER: ("/usr/bin/zenohd", "install zenohd, Zenoh's router: https://zenoh.io/docs/getting-started/installation"),
    WEB: ("/usr/bin/caddy", "apt-get install caddy"),
}
_UDEV = "udevadm control --reload && udevadm trigger --subsystem-match=tty"
# Debian's Caddy, which its package's updates start again, would hold the ports of a page.
_PAGE = "systemctl mask --now caddy.service"


@dataclass(frozen=True)
class HostFile:
    """A file by its ``path`` below the root; one that has an ``owner`` is read by this user only."""

    path: PurePosixPath
    content: bytes
    owner: str | None = None

    @property
    def mode(self) -> int:
        """Its permissions."""
        return 0o644 if self.owner is None else 0o600


def hosts(fleet: Fleet) -> list[str]:
    """The names of all hosts, in the order of their first programs."""
    return list(dict.fromkeys(each.host for each in programs(fleet)))


def host_files(fleet: Fleet, host: str, certificates: Mapping[str, Path]) -> list[HostFile]:
    """The files of a host; ``certificates`` has the rendered folder of each subject. Raises OSError."""
    own = [each for each in programs(fleet) if each.host == host]
    found = [*_of_systemd(fleet, own), *_of_programs(fleet, own), *_of_bus(fleet, own, certificates)]
    found.append(HostFile(PurePosixPath("etc/tmpfiles.d/noctule.conf"), units.owners(_private(found)).encode()))
    gateways = [each for each in fleet.gateway if each.host == host]
    return [
        *found,
        HostFile(PurePosixPath("install.sh"), _install(fleet, host, own, found).encode()),
        HostFile(PurePosixPath("compose.yaml"), compose(own, gateways).encode()),
    ]


def _of_systemd(fleet: Fleet, own: list[Program]) -> Iterator[HostFile]:
    yield HostFile(PurePosixPath("etc/sysusers.d/noctule.conf"), units.users(own).encode())
    pages = {each.name: each.web.port for each in fleet.viewer if each.web}
    serial = {each.name: devices(each) for each in fleet.gateway}
    for each in own:
        web_port = pages[each.name] if each.role == WEB else None
        text = units.unit(each, web_port, serial[each.name] if each.role == "gateway" else ())
        yield HostFile(PurePosixPath("etc/systemd/system") / each.service, text.encode())


def _of_programs(fleet: Fleet, own: list[Program]) -> Iterator[HostFile]:
    names = {(each.role, each.name) for each in own}
    gateways = [each for each in fleet.gateway if ("gateway", each.name) in names]
    if rules := udev.rules(gateways):
        yield HostFile(PurePosixPath("etc/udev/rules.d/61-noctule.rules"), rules.encode())
    for each in gateways:
        if each.site_file:
            yield HostFile(site_file(each).relative_to("/"), Path(each.site_file).read_bytes())
    for each in fleet.viewer:
        if each.web and (WEB, each.name) in names:
            # It has hashes of passwords.
            yield HostFile(CADDYFILE.relative_to("/"), caddyfile(each, each.web).encode(), f"noctule-{WEB}")


def _of_bus(fleet: Fleet, own: list[Program], certificates: Mapping[str, Path]) -> Iterator[HostFile]:
    for each in own:
        if each.subject:
            folder = certificate_folder(fleet, each.subject).relative_to("/")
            for file in sorted(certificates[each.subject].iterdir()):
                yield HostFile(folder / file.name, file.read_bytes(), each.user)


def _install(fleet: Fleet, host: str, own: list[Program], found: list[HostFile]) -> str:
    needs = [_NEEDS[each.role] for each in own if each.role in _NEEDS]
    wheels = ["noctule", *dict.fromkeys(_PACKAGES[each.role] for each in own if each.role in _PACKAGES)]
    has_udev = any("udev" in each.path.parts for each in found)
    return Template(files("noctule_deploy").joinpath("templates", "install.sh").read_text()).substitute(
        host=host,
        needs="\n".join(f'[ -n "$staged" ] || [ -x {program} ] || fail "{what}"' for program, what in needs),
        packages=" ".join(wheels),
        folder=PurePosixPath(fleet.folder).relative_to("/"),
        files="\n".join(f"put {each.path} {each.mode:o}" for each in found),
        services=" ".join(each.service for each in own),
        udev=_UDEV if has_udev else "",
        page=_PAGE if any(each.role == WEB for each in own) else "",
    )


def _private(found: list[HostFile]) -> dict[PurePosixPath, str]:
    """Of each file that is read by one user only, this user."""
    return {PurePosixPath("/") / each.path: each.owner for each in found if each.owner}
