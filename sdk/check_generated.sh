#!/bin/sh
# Fail if the committed code of the messages is not what proto/ gives.
set -eu
cd "$(dirname "$0")"
fresh=$(mktemp -d)
trap 'rm -rf "$fresh"' EXIT
sh generate.sh "$fresh"
for file in messages_pb2.py messages_pb2.pyi; do
    cmp -s "$fresh/$file" "src/noctule/$file" || { echo "sdk/src/noctule/$file is not what proto/ gives: run sdk/generate.sh" >&2; exit 1; }
done
