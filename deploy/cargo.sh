#!/bin/sh
# Run cargo: the machine's own, else the one that building the simulator fetched for itself.
if ! command -v cargo >/dev/null; then
    fetched=${XDG_CACHE_HOME:-$HOME/.cache}/puccinialin
    export CARGO_HOME="$fetched/cargo" RUSTUP_HOME="$fetched/rustup" PATH="$fetched/cargo/bin:$PATH"
fi
exec cargo "$@"
