#!/bin/sh
# Make the Python code of the messages from proto/ again; `make lint` checks that this has been done.
set -eu
cd "$(dirname "$0")"
out=${1:-src/noctule}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python -m grpc_tools.protoc -I proto --python_out="$work" --pyi_out="$work" proto/noctule/v1/noctule.proto
mv "$work/noctule/v1/noctule_pb2.py" "$out/messages_pb2.py"
mv "$work/noctule/v1/noctule_pb2.pyi" "$out/messages_pb2.pyi"
