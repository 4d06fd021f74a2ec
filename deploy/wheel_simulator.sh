#!/bin/sh
# wheel_simulator.sh UV FOLDER: build the simulator's wheel into the folder. Its build tag says of which sources it is.
set -eu

made=$(mktemp -d)
trap 'rm -r "$made"' EXIT
"$1" build --quiet --wheel --package noctule-sim --out-dir "$made"
name=$(basename "$made"/*.whl)
tags=${name#noctule_sim-*-}
mkdir -p "$2"
wheel="$2/${name%"$tags"}0$(sh deploy/simulator_sources.sh)-$tags" # a build tag begins with a digit
mv "$made/$name" "$wheel"
echo "$wheel"
