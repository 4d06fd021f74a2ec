#!/bin/sh
# sync.sh UV ARGUMENT...: install what the lock file says into .venv, the simulator as simulator.sh finds it. Says what
# it does where there is anything to do. SIZE is what all of it is.
set -eu

uv=$1
shift
simulator=$(sh deploy/simulator.sh)
if [ "$simulator" != build ]; then
    case " $* " in
    *" --inexact "*) ;;
    *) set -- --inexact "$@" ;; # an exact one removes the simulator that is there
    esac
    set -- --no-install-package noctule-sim "$@"
fi
if [ -e .venv/simulator-sources ] && "$uv" sync --locked --quiet --check "$@" >/dev/null 2>&1; then
    set -- --quiet "$@"
elif [ "$simulator" = build ]; then
    echo "Fetching Python packages (${SIZE:-900 MB} where none is here yet) and building the simulator: up to three minutes"
else
    echo "Fetching Python packages (${SIZE:-900 MB} where none is here yet): up to two minutes"
fi
"$uv" sync --locked "$@"
case $simulator in
*.whl) "$uv" pip install --python .venv --quiet --no-deps --no-index --reinstall "$simulator" ;;
esac
sh deploy/simulator_sources.sh >.venv/simulator-sources # for simulator.sh, once no wheel is there any more
