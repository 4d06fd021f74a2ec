#!/bin/sh
# step.sh NAME WORDS COMMAND...: one step of the set-up, in one line: its WORDS. What the command prints goes into
# .tools/NAME.log, which is shown where it fails. A terminal shows the seconds and the log's last line meanwhile.
set -eu

log=.tools/$1.log
words=$2
shift 2
mkdir -p .tools
echo "$words"
watcher=
if [ -t 1 ]; then
    started=$(date +%s)
    while kill -0 $$ 2>/dev/null && sleep 1; do
        printf '\r\033[K  %d s  %s' $(($(date +%s) - started)) "$(tail -n 1 "$log" | tr -d '\r' | sed 's|^ *||' | cut -c 1-60)"
    done &
    watcher=$!
fi
end() {
    [ -z "$watcher" ] || { kill "$watcher" 2>/dev/null && printf '\r\033[K'; }
}
trap end EXIT
trap 'exit 130' INT
trap 'exit 129' HUP
trap 'exit 143' TERM
: >"$log"
status=0
"$@" >>"$log" 2>&1 || status=$?
if [ "$status" -ne 0 ]; then
    end
    watcher=
    tail -n 20 "$log" >&2
    echo "This failed: $words. The lines above are the end of $log." >&2
    exit "$status"
fi
