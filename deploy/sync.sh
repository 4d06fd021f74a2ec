#!/bin/sh
# sync.sh UV ARGUMENT...: install what the lock file says into .venv, the simulator as simulator.sh finds it. Says what
# it does where there is anything to do. SIZE is what all of it is.
set -eu

uv=$1
shift
simulator=$(sh deploy/simulator.sh)

sync() { # NAME WORDS ARGUMENT...
    name=$1
    words=$2
    shift 2
    if [ -e .venv/simulator-sources ] && "$uv" sync --locked --quiet --check "$@" >/dev/null 2>&1; then
        "$uv" sync --locked --quiet "$@"
    else
        sh deploy/step.sh "$name" "$words" "$uv" sync --locked "$@"
    fi
}

case " $* " in
*" --inexact "*) inexact= ;;
*) inexact=--inexact ;; # an exact one removes the simulator that is there
esac
sync packages "Fetching Python packages (${SIZE:-900 MB} where none is here yet): up to two minutes" \
    --no-install-package noctule-sim $inexact "$@"
case $simulator in
build) sync simulator "Building the simulator: up to two minutes" "$@" ;;
*.whl) "$uv" pip install --python .venv --quiet --no-deps --no-index --reinstall "$simulator" ;;
esac
sh deploy/simulator_sources.sh >.venv/simulator-sources # for simulator.sh, once no wheel is there any more
