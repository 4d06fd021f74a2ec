#!/bin/sh
# twice.sh ARGUMENT...: run pytest, and what failed once more by itself. Real programs run beside one another on a small
# and busy machine, and one that was starved there is not broken. What fails twice has failed, and so has a run with more
# than MANY failures. What passed only by itself is named at the end: it wants mending, though it stops nobody.
set -u

MANY=5

pytest "$@" --cache-clear
status=$?
[ $status -eq 1 ] || exit $status # 1: tests failed; else nothing did, or the run itself broke

failed=.pytest_cache/v/cache/lastfailed
names=$(python -c 'import json, sys; print("\n".join(json.load(open(sys.argv[1]))))' $failed) || exit 1
[ "$(echo "$names" | wc -l)" -le $MANY ] || exit 1
echo "These failed beside the others, and run once more by themselves:"
echo "$names"
pytest "$@" --last-failed --last-failed-no-failures none --numprocesses 0 || exit 1
echo "UNSTEADY, passed only by themselves:"
echo "$names"
