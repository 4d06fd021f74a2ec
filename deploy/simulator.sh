#!/bin/sh
# Print where the simulator comes from: `build` (there is a Rust compiler), else the path of its wheel, else `installed`.
# Where there is none of these, say the one line to type. SIMULATOR_WHEELS is the folder of the wheel.
set -eu

needed=1.88.0
folder=${SIMULATOR_WHEELS:-dist/simulator}
own=$(sed -n 's/^version = "\(.*\)"$/\1/p' firmware/simulator/pyproject.toml)

if command -v cargo >/dev/null; then
    version=$(cargo --version 2>/dev/null | cut -d' ' -f2)
    if [ "$(printf '%s\n' "$needed" "$version" | sort -V | head -n 1)" = "$needed" ]; then
        echo build
        exit
    fi
    problem="cargo ${version:-without a toolchain} is too old for the simulator, which needs $needed"
    line="rustup update stable"
elif [ "${RUST:-}" = fetch ] || [ -x "${XDG_CACHE_HOME:-$HOME/.cache}/puccinialin/cargo/bin/cargo" ]; then
    echo build # maturin fetches a compiler for itself, or has done so
    exit
else
    problem="the simulator is built with Rust, which is not here (700 MB into ~/.cache/puccinialin)"
    line="make ${GOAL:-demo} RUST=fetch"
fi

for wheel in "$folder/noctule_sim-$own"-*_"$(uname -m)".whl; do
    if [ -e "$wheel" ]; then
        echo "$wheel"
        exit
    fi
done
if [ "$(.venv/bin/noctule-sim --version 2>/dev/null)" = "noctule-sim $own" ]; then
    echo installed
    exit
fi
cat >&2 <<END
Nothing was done: $problem, and $folder has no wheel of it. Type:
    $line
END
exit 1
