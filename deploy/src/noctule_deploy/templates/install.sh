#!/bin/sh
# Made by noctule-deploy render: installs host $host, and brings it up to date when it is run again.
#   sh install.sh WHEELS      WHEELS is the folder that make wheels has filled
# DESTDIR=FOLDER sh install.sh puts the files below FOLDER and does no more: for a look at them, or for a package.
set -eu
here=$$(cd "$$(dirname "$$0")" && pwd)
root=$${DESTDIR:-}
wheels=$${1:-$$here/wheels}
venv=/opt/noctule
changed=

fail() { echo "install.sh: $$1" >&2; exit 1; }
put() { # FILE MODE: a file of this folder goes to its place, unless it is there already
    cmp -s "$$here/$$1" "$$root/$$1" && return
    install -D -m "$$2" "$$here/$$1" "$$root/$$1"
    echo "$$root/$$1 has changed"
    changed=yes
}
only() { # FOLDER: nothing stays in it that this folder does not have
    [ -d "$$root/$$1" ] || return 0
    for file in $$(cd "$$root/" && find "$$1" -type f); do
        [ ! -e "$$here/$$file" ] || continue
        rm "$$root/$$file"
        echo "$$root/$$file is of no more use: removed"
        changed=yes
    done
    find "$$root/$$1" -type d -empty -delete
}

[ -n "$$root" ] || [ "$$(id -u)" -eq 0 ] || fail "run it as root"
$needs

packages() { # Files and not names, so that no package of these names comes from anywhere else.
    set -- $packages
    stamp=$$({ echo '$packages'; cat "$$wheels"/*.whl "$$wheels"/constraints.txt; } | sha256sum)
    [ "$$stamp" != "$$(cat "$$venv/stamp" 2>/dev/null || true)" ] || return 0
    # The system's own Python: the services can't see one in somebody's home.
    [ -x "$$venv/bin/pip" ] || /usr/bin/python3 -m venv "$$venv" || fail "apt-get install python3-venv"
    "$$venv/bin/pip" install --quiet --disable-pip-version-check --constraint "$$wheels/constraints.txt" "$$@"
    "$$venv/bin/pip" install --quiet --disable-pip-version-check --no-deps --force-reinstall "$$@"
    echo "$$stamp" >"$$venv/stamp"
    echo "$$venv has changed"
    changed=yes
}

if [ -z "$$root" ]; then
    ls "$$wheels"/noctule-*.whl >/dev/null 2>&1 || fail "$$wheels has no wheels: make wheels in the project, copy dist here, name it"
    packages
fi
only etc/noctule/bus
$files

[ -z "$$root" ] || exit 0
systemd-sysusers noctule.conf
systemd-tmpfiles --create noctule.conf
for unit in /etc/systemd/system/noctule-*.service; do
    case " $services " in *" $${unit##*/} "*) continue ;; esac
    [ -e "$$unit" ] || continue
    systemctl disable --now "$${unit##*/}" # it has left this host
    rm "$$unit"
done
systemctl daemon-reload
$udev
systemctl enable $services
if [ -n "$$changed" ]; then systemctl restart $services; else systemctl start $services; fi
echo "$host is up: $services"
