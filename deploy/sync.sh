#!/bin/sh
# sync.sh UV ARGUMENT...: install what the lock file says into .venv, the simulator as simulator.sh finds it.
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
if [ -d .venv ]; then
    set -- --quiet "$@"
elif [ "$simulator" = build ]; then
    echo "Fetching Python packages (${SIZE:-900 MB}) and building the simulator: two to three minutes"
else
    echo "Fetching Python packages (${SIZE:-900 MB}): one to two minutes"
fi
"$uv" sync --locked "$@"
case $simulator in
*.whl) "$uv" pip install --python .venv --quiet --no-deps --no-index --reinstall "$simulator" ;;
esac
sh deploy/simulator_sources.sh >.venv/simulator-sources # for simulator.sh, once no wheel is there any more
