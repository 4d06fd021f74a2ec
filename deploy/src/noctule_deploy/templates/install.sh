#!/bin/sh
# Made by noctule-deploy render: installs host $host, and brings it up to date when it is run again.
#   sh install.sh WHEELS      WHEELS is the folder that make wheels has filled
# DESTDIR=FOLDER sh install.sh puts the files below FOLDER and does no more: for a look at them, or for a package.
set -eu
umask 022
here=$$(cd "$$(dirname "$$0")" && pwd)
root=$${DESTDIR:-}
staged=$${DESTDIR:+yes}
wheels=$${1:-$$here/wheels}
venv=$$root/opt/noctule
python=/usr/bin/python3 # the system's own: the services can't see one in somebody's home
# It is there from the first change until the services have started again, also when a run was cut off between the two.
marker=$$root/var/lib/noctule/restart
listed=

fail() { echo "install.sh: $$1" >&2; exit 1; }
changing() { # WHAT: said and noted before it changes
    echo "$$1"
    [ -z "$$staged" ] || return 0
    mkdir -p "$${marker%/*}"
    : >"$$marker"
}
put() { # FILE MODE: a file of this folder goes to its place, unless it is there already
    listed="$$listed $$1"
    cmp -s "$$here/$$1" "$$root/$$1" && return
    changing "$$root/$$1 changes"
    install -D -m "$$2" "$$here/$$1" "$$root/$$1"
}
only() { # FOLDER: in its folders ROLE.NAME nothing stays that was not put there; all else is somebody's own
    for file in "$$root/$$1"/router.*/* "$$root/$$1"/gateway.*/* "$$root/$$1"/mapper.*/* "$$root/$$1"/viewer.*/*; do
        [ -f "$$file" ] || continue
        folder=$${file%/*}
        case $${folder##*/} in *.*.*) continue ;; esac # ROLE.NAME.GENERATION was copied by hand
        case " $$listed " in *" $${file#"$$root/"} "*) continue ;; esac
        changing "$$file is of no more use and is removed"
        rm "$$file"
        rmdir "$$folder" 2>/dev/null || true
    done
}

[ -n "$$staged" ] || [ "$$(id -u)" -eq 0 ] || fail "run it as root"
$needs

one() { # FILE...: the wheels of one package
    [ -e "$$1" ] || fail "$$1 is not there: make wheels in the project, copy dist here, name it"
    [ $$# -eq 1 ] || fail "$$wheels has $$# versions of a package ($$*): remove the folder, and copy dist again"
}
packages() { # Files and not names, so that no package of these names comes from anywhere else.
    set --
    for package in $packages; do
        one "$$wheels/$$package"-*.whl
        set -- "$$@" "$$wheels/$$package"-*.whl
    done
    version=$$("$$python" -V) || fail "apt-get install python3-venv"
    stamp=$$({ echo "$$version $packages"; cat "$$@" "$$wheels/constraints.txt"; } | sha256sum)
    [ "$$stamp" != "$$(cat "$$venv/stamp" 2>/dev/null || true)" ] || return 0
    changing "$$venv changes"
    if [ ! -x "$$venv/bin/pip" ] || [ "$$version" != "$$(cat "$$venv/version" 2>/dev/null || true)" ]; then
        # Another Python does not see what was installed for the one before.
        "$$python" -m venv --clear "$$venv" || fail "apt-get install python3-venv"
        echo "$$version" >"$$venv/version"
    fi
    "$$venv/bin/pip" install --quiet --disable-pip-version-check --constraint "$$wheels/constraints.txt" "$$@"
    "$$venv/bin/pip" install --quiet --disable-pip-version-check --no-deps --force-reinstall "$$@"
    echo "$$stamp" >"$$venv/stamp"
}

[ -n "$$staged" ] || packages
$files
only $folder

[ -z "$$staged" ] || exit 0
systemd-sysusers noctule.conf
systemd-tmpfiles --create noctule.conf
for unit in "$$root"/etc/systemd/system/noctule-*.service; do
    case " $services " in *" $${unit##*/} "*) continue ;; esac
    grep -qs '^# Made by noctule-deploy' "$$unit" || continue # somebody's own
    systemctl disable --now "$${unit##*/}" # it has left this host
    case $${unit##*/} in noctule-web-*) systemctl unmask caddy.service ;; esac
    rm "$$unit"
done
systemctl daemon-reload
$udev
$page
systemctl enable $services
if [ -e "$$marker" ]; then systemctl restart $services; else systemctl start $services; fi
rm -f "$$marker"
echo "$host is up: $services"
