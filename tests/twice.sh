#!/bin/sh
# twice.sh ARGUMENT...: run pytest, and the files with a failure once more by themselves. Real programs run beside one
# another on a small and busy machine, and one that was starved there is not broken. What fails twice has failed, and so
# has a run with more than MANY failures. What passed only by itself is named at the end: mend it, though the run passes.
set -u

MANY=5

pytest "$@" --cache-clear
status=$?
[ $status -eq 1 ] || exit $status # 1: tests failed; else nothing did, or the run itself broke

names=$(python -c 'import json, sys; print(*json.load(open(sys.argv[1])), sep="\n")' .pytest_cache/v/cache/lastfailed) || exit 1
[ "$(echo "$names" | wc -l)" -le $MANY ] || exit 1
echo "These failed beside the others, and their files run once more by themselves:"
echo "$names"
pytest "$@" --numprocesses 0 $(echo "$names" | sed 's/::.*//' | sort -u) || exit 1
echo "UNSTEADY, passed only by themselves:"
echo "$names"
