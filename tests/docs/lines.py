"""How the command lines of the pages are typed on a machine without hardware, without root and without other hosts."""

from dataclasses import dataclass, replace

ALL_IS_WELL, NOT_ALL_IS_WELL, WARNINGS = 0, 1, 3  # sdk/README.md, exit status


@dataclass(frozen=True)
class Typed:
    """A line of the pages. It is typed as it stands unless ``instead`` is given, with ``more`` behind it: the test's
    own ports and folders, as in ``str.format``. ``until``, a regular expression, is what it prints, or writes ``into``
    files, before Ctrl-C ends it. ``shows`` is what the page says that one sees, ``status`` what exit status it allows.
    """

    instead: str = ""
    more: str = ""
    until: str = ""
    into: str = ""
    shows: str = ""
    status: tuple[int, ...] = (ALL_IS_WELL,)


_TESTS_THEMSELVES = "these tests are part of it"
_ANOTHER_HOST = "is about another host, as root; tests/deploy/test_install_script.py runs what it runs there"
_ADAPTER = "needs a debug adapter, and the program of its maker"
_DOCKER = "needs a container engine; tests/deploy/test_container_image.py builds the image and runs it"
_SIMULATOR_TESTS = "make test and make lint run it"
_FLEET = "needs a running fleet; tests/deploy/test_secured_programs.py runs it on one"

NOT_TYPED = {
    "rsync -a --delete rendered/attic-pi ../dist attic-pi:": _ANOTHER_HOST,
    "ssh attic-pi sudo sh attic-pi/install.sh dist": _ANOTHER_HOST,
    "ssh -L 9090:127.0.0.1:9090 -L 9876:127.0.0.1:9876 mapper.example": "tests/viewer/test_tunnel.py does this",
    "NOCTULE_TLS=~/operator.anna.g1 noctule rpc house u1 stop": _FLEET,
    "noctule-mapper run --site house --data map --tls ~/mapper.mapper-1.g1": _FLEET,
    "noctule-gateway run site.toml --data /var/lib/noctule --tls /etc/noctule/bus": _FLEET,
    "docker build --file deploy/container/Containerfile --tag noctule .": _DOCKER,
    "mkdir -p data && export NOCTULE_USER=$(id -u):$(id -g) && docker compose up --detach": _DOCKER,
    "sudo ec2device --port=USB": _ADAPTER,
    "sudo ec2writeflash --port=USB --mode=c2 --hex --run firmware/build/unit-7.hex": _ADAPTER,
    "sudo ec2readflash --port=USB --mode=c2 --len=0x7FE0 --bin read.bin": _ADAPTER,
    "cmp --bytes=32736 read.bin image.bin": _ADAPTER,
    "sudo device8051 -slist": _ADAPTER,
    "sudo flash8051 -sn EC3000000 -tif c2 -erasemode page -upload firmware/build/unit-7.hex": _ADAPTER,
    "cargo test --release": _SIMULATOR_TESTS,
    "cargo clippy --all-targets && cargo fmt --check": _SIMULATOR_TESTS,
    "noctule-mapper reproduce --out FOLDER [--seeds 50] [--seed 1] [--jobs N]": "says what the one of SLOW takes",
}
"""Lines that no test types, and why."""

_DRY = {
    "demo": "tests/system/test_demo.py runs what it starts",
    "docs": "make lint runs it",
    "screenshots": "it takes minutes",
    "hardware": "tests/firmware/test_hardware_pages.py reads what it has drawn",
    "setup wheels": "tests/deploy/test_installed_packages.py installs them",
    **dict.fromkeys(("test", "lint", "soak", "bench"), _TESTS_THEMSELVES),
}
"""Targets of make that are only looked at (--dry-run), and why."""

SLOW = {
    "noctule-mapper reproduce --out figures": "it simulates and maps 50 surveys, here two",
    "make -C firmware check": "cppcheck goes over all sources",
}
"""Lines that are typed in the soak, and why."""

LISTENS = "LISTENS"  # on its port: what is awaited of a program that prints nothing
PLACES = {
    "SITE": "attic",
    "UNIT": "u7",
    "sudo": "",
    "/var/lib/noctule": "var/lib/noctule",
    "/mnt/copy": "mnt/copy",
    "/run/units": "run/units",
}
"""What stands for a reader's own name, and what root alone may do or make, with what is typed in its place."""

_RELAY = Typed(more="--port {port} --web-port {next_port}", until=r"http://127\.0\.0\.1:\d+/")
_GATEWAY = Typed(more="--listen tcp/127.0.0.1:{port}", until="u3")
_SIMULATOR = Typed(more="--tcp 127.0.0.1:{port}", until="unit 1.*socket://")
_DOCTOR = (ALL_IS_WELL, NOT_ALL_IS_WELL, WARNINGS)
_SHARE = "--rerun none --connect {endpoint}"
_NO_FIXED_UNIT = Typed(more="--connect {endpoint}", status=(NOT_ALL_IS_WELL,), shows="takes fixed units")
_CAMPAIGN = Typed(shows=r"u7\W+(updated|up to date)")

LINES = {
    **{f"make {targets}": Typed(f"make --dry-run {targets}") for targets in _DRY},
    'make setup wheels && export PATH="$PWD/.venv/bin:$PATH"': Typed(
        'make --dry-run setup wheels && export PATH="$PWD/.venv/bin:$PATH"'
    ),
    "noctule-deploy check": Typed(shows="all is well"),
    "noctule-deploy status": Typed(status=(NOT_ALL_IS_WELL,), shows="no router answers"),
    "noctule-deploy firmware-sign update.hex --key release.pem": Typed(
        "cp ../firmware/build/update.hex . && noctule-deploy firmware-sign update.hex --key release.pem"
    ),
    "noctule-gateway backup /var/lib/noctule/gateway.attic gateway-copy": Typed(
        "noctule-gateway backup gateway-data gateway-copy"
    ),
    "noctule-mapper backup /var/lib/noctule/mapper.mapper-1 mapper-copy": Typed(
        "noctule-mapper backup mapper-data mapper-copy"
    ),
    "noctule-deploy firmware-key release.pem": Typed(shows=r"\[firmware.keys\]"),
    "noctule doctor attic.toml": Typed(status=_DOCTOR, shows="ok +site file"),
    "noctule doctor attic.toml --data gateway-data": Typed(status=_DOCTOR, shows="(?s)ok +site file.*ok +router"),
    "noctule-viewer run": _RELAY,
    "noctule-viewer run --site attic": _RELAY,
    "noctule-viewer run --record FOLDER": replace(_RELAY, until=".", into="FOLDER/*.rrd"),
    "noctule-viewer run --site SITE --connect ENDPOINT": replace(
        _RELAY, instead="noctule-viewer run --site attic --connect {endpoint}"
    ),
    "noctule-viewer run --site SITE.toml --connect ENDPOINT": replace(
        _RELAY, instead="noctule-viewer run --site attic.toml --connect {endpoint}"
    ),
    "noctule-viewer run --site SITE --floor-plan PLAN.dxf --connect ENDPOINT": replace(
        _RELAY, instead="noctule-viewer run --site attic --floor-plan plan.dxf --connect {endpoint}"
    ),
    "noctule-viewer open": Typed(shows="There is no screen here"),
    "noctule-viewer open FILE.rrd": Typed(
        "noctule-mapper fit paper.jsonl --rrd map.rrd && noctule-mapper export paper.jsonl plan.dxf"
        " && noctule-viewer open map.rrd",
        shows="There is no screen here",
    ),
    "noctule-viewer days FOLDER": Typed(shows=r"\d{4}-\d\d-\d\d .* MB"),
    "noctule-viewer open FOLDER --day 2026-11-28": Typed(
        "noctule-viewer open FOLDER --day $(noctule-viewer days FOLDER | head -n 1 | cut -c 1-10)",
        shows="There is no screen here",
    ),
    "noctule units attic.toml": Typed(shows="u7 "),
    "noctule watch attic": Typed(until=r"\bu\d"),
    "noctule record attic attic.jsonl": Typed(until=".", into="attic.jsonl"),
    "noctule-gateway run site.toml --data /var/lib/noctule": _GATEWAY,
    "noctule-gateway run site.toml --data /var/lib/noctule --connect tcp/router-1:7447": Typed(
        "noctule-gateway run site.toml --data /var/lib/noctule --connect {endpoint}", until=_GATEWAY.until
    ),
    "noctule-gateway router": Typed(more="--listen tcp/127.0.0.1:{port}", until=LISTENS),
    "noctule-gateway check gateway-data": Typed(shows="all is sound"),
    "noctule-gateway update attic.toml --image firmware/build/update.hex": Typed(
        "noctule-gateway update site.toml --image firmware/build/update.hex", shows="u3"
    ),
    "noctule-sim": _SIMULATOR,
    "noctule-sim --room l-shaped --units 3 --speed 10": _SIMULATOR,
    "noctule-sim --room lounge": _SIMULATOR,
    "noctule-sim --pty /run/units": Typed(until="unit 1.*unit-1"),
    "noctule-sim --room attic-room.toml --svg attic.svg": Typed(more="&& grep -q '<svg' attic.svg"),
    "noctule-sim --room attic-room.toml --site attic-room-site.toml": Typed(
        more="&& grep -q 'closed = false' attic-room-site.toml"
    ),
    "noctule-mapper share --name m1 --site attic --site hall --data mapper-data": Typed(
        "noctule-mapper share --name m1 --site attic --site hall --data shared-data", _SHARE, until="maps site hall"
    ),
    "noctule-mapper share --name m1 --site attic --site hall --site yard --data mapper-data": Typed(
        "noctule-mapper share --name m1 --site attic --site hall --site yard --data yard-data",
        _SHARE,
        until="maps site yard",
    ),
    "noctule-mapper repair mapper-data --site attic --unit u7": Typed(
        "noctule-mapper repair mapper-copy --site attic --unit u7"  # no mapper runs on it
    ),
    "noctule-mapper fit radar.jsonl --svg room.svg --view": Typed(shows="There is no screen here"),
    "noctule rpc SITE UNIT update --image firmware/build/update.hex": Typed(
        "noctule rpc attic u7 update --image firmware/build/update.hex"
    ),
    # The units of this site are carried: tests/mapper/test_unit_survey.py and tests/gateway/test_health_memory.py have
    # units that stand still.
    "noctule-mapper survey --site attic.toml --write": _NO_FIXED_UNIT,
    "noctule-mapper survey --site FILE [SURVEY] [--write] [--unit NAME ...] [--connect ENDPOINT]"
    " [--tls FOLDER]": replace(_NO_FIXED_UNIT, instead="noctule-mapper survey --site attic.toml"),
    "noctule rpc SITE u1 accept_room": Typed(status=(NOT_ALL_IS_WELL,), shows="the unit is carried"),
    "noctule-gateway repair /var/lib/noctule --unit u1": Typed("noctule-gateway repair /var/lib/noctule --unit u3"),
    "noctule-mapper reproduce --out figures": Typed(more="--seeds 2 --jobs 1"),
    # What a command takes, beside what it does.
    "noctule units SITE|SITE.toml [--watch]": Typed("noctule units attic", shows="u7 "),
    "noctule unit-report SITE UNIT [--json]": Typed("noctule unit-report attic u7 --json", shows=r"(?s)^\{.*\}\s*$"),
    "noctule watch SITE [--json]": Typed("noctule watch attic --json", until=r"\{"),
    "noctule record SITE OUT.jsonl|OUT.mcap": Typed("noctule record attic out.mcap", until=".", into="out.mcap.jsonl"),
    "noctule replay SURVEY --site S": Typed(
        "noctule replay paper.jsonl --site s --speed max", until="has been published"
    ),
    "noctule log SITE UNIT --from N": Typed("noctule log attic u7 --from 1", shows='"unit": ?"u7"'),
    "noctule import radar.csv --angle angle --range distance_cm --x x_m --y y_m --heading heading_deg"
    " --forward-deg 90 --no-echo 0": Typed(shows="44 places"),
    "noctule import SCAN --angle C --range C": Typed(
        "noctule import radar.csv --angle angle --range distance_cm --out scan.jsonl"
    ),
    "noctule schema [MESSAGE]": Typed("noctule schema noctule.v1.Sweep", shows="readings"),
    "noctule doctor [SITE.toml]": Typed("noctule doctor", status=_DOCTOR),
    "noctule update firmware/build/update.hex --site attic": _CAMPAIGN,
    "noctule update firmware/build/update.hex --site SITE": _CAMPAIGN,
    "noctule update firmware/build/update.hex --site attic --first 2 --group 10 --max-failed 0.2": _CAMPAIGN,
    "noctule update IMAGE --site S": replace(
        _CAMPAIGN, instead="noctule update firmware/build/update.hex --site attic"
    ),
    "noctule rpc attic u7 settings": Typed(shows="4080.5"),
    "noctule rpc SITE UNIT COMMAND": Typed("noctule rpc attic u7 status", shows="u7"),
    "noctule-mapper fit SURVEY [--contour FILE] [--svg FILE] [--rrd FILE] [--view] [--contacts FILE] [--method M]"
    " [--rule R] [--sensor F] [--config F]": Typed(
        "noctule-mapper fit paper.jsonl --contour contour.json --contacts contacts.csv --method refined --rule pcr6+"
        " --config contour.config.toml"
    ),
    "noctule-mapper calibrate wall.jsonl --wall-distance 0.3 --site attic.toml": Typed(
        more="&& grep -qF '[sensor]' attic.toml"
    ),
    "noctule-mapper calibrate SURVEY [--wall-distance M] [--facing-deg D] [--unit NAME] [--site FILE]"
    " [--out FILE]": Typed("noctule-mapper calibrate wall.jsonl --wall-distance 0.3 --out sensor.toml"),
    "noctule-mapper export INPUT OUT [--method M] [--rule R] [--sensor F] [--config F]": Typed(
        "noctule-mapper export paper.jsonl paper.yaml"
    ),
    "noctule-mapper check DATA": Typed("noctule-mapper check mapper-data"),
    "noctule-mapper backup DATA OUT": Typed("noctule-mapper backup mapper-data another-copy"),
    "noctule-mapper repair DATA --site S --unit U": Typed("noctule-mapper repair another-copy --site attic --unit u1"),
}
"""Lines that are not typed as they stand, that go on until Ctrl-C, or whose page says what one sees."""
