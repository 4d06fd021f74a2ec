#!/bin/sh
# Print where the simulator comes from: `build` (there is a Rust compiler), else the path of its wheel, else `installed`.
# These two count if they are of the present sources, and not for a goal that NEEDS_CARGO itself. Where there is none of
# the three, say the one line to type. SIMULATOR_WHEELS is the folder of the wheel.
set -eu

needed=1.88.0
folder=${SIMULATOR_WHEELS:-dist/simulator}

if command -v cargo >/dev/null; then
    version=$(cargo --version 2>/dev/null | cut -d' ' -f2)
    if [ "$(printf '%s\n' "$needed" "$version" | sort -V | head -n 1)" = "$needed" ]; then
        echo build
        exit
    fi
    problem="the simulator needs cargo $needed, and the one here ${version:+is }${version:-has no toolchain}"
    line="rustup update stable && rustup default stable"
    # Debian's cargo comes without rustup, whose installer asks about it unless it is told -y.
    command -v rustup >/dev/null || line="curl https://sh.rustup.rs -sSf | sh -s -- -y    # then open a new shell"
elif [ "${RUST:-}" = fetch ] || [ -x "${XDG_CACHE_HOME:-$HOME/.cache}/puccinialin/cargo/bin/cargo" ]; then
    echo build # maturin fetches a compiler for itself, or has done so
    exit
else
    problem="the simulator is built with Rust, which is not here (700 MB into ~/.cache/puccinialin)"
    line="make ${GOAL:-demo} RUST=fetch"
fi

if [ -n "${NEEDS_CARGO:-}" ]; then
    otherwise="make $NEEDS_CARGO runs cargo itself"
else
    otherwise="$folder has no wheel of its present sources"
    sources=$(sh deploy/simulator_sources.sh)
    for wheel in "$folder"/noctule_sim-*-"0$sources"-*_"$(uname -m)".whl; do
        if [ -e "$wheel" ]; then
            echo "$wheel"
            exit
        fi
    done
    if [ -x .venv/bin/noctule-sim ] && [ "$(cat .venv/simulator-sources 2>/dev/null)" = "$sources" ]; then
        echo installed
        exit
    fi
fi
cat >&2 <<END
Nothing was done: $problem, and $otherwise. Type:
    $line
END
exit 1
