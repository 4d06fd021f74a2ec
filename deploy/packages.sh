#!/bin/sh
# Install the Debian packages that the demo (run), the tests (test) or the bench need; without root, print the one line
# to type. Nothing is installed where the simulator can neither be built nor has a wheel.
set -eu

simulator=$(sh deploy/simulator.sh)
run="sdcc sdcc-libraries"
[ "$simulator" != build ] || run="gcc libc6-dev $run"
test="$run gcc libc6-dev sdcc-ucsim cppcheck strace mesa-vulkan-drivers libgl1-mesa-dri libxkbcommon-x11-0 chromium git systemd caddy iproute2 buildah openssh-client"
bench="$test g++ libmrpt-maps-dev"
case $1 in
run) wanted=$run ;;
test) wanted=$test ;;
bench) wanted=$bench ;;
*) echo "usage: packages.sh run|test|bench" >&2; exit 2 ;;
esac

missing=
for package in $wanted; do
    dpkg-query --show --showformat='${db:Status-Status}' "$package" 2>/dev/null | grep -qx installed || missing="$missing $package"
done
if [ -n "$missing" ]; then
    if [ "$(id -u)" -ne 0 ]; then
        echo "Packages are missing; type: sudo apt-get install --yes$missing" >&2
        exit 1
    fi
    export DEBIAN_FRONTEND=noninteractive
    install="apt-get install --yes --no-install-recommends$missing"
    if ! sh deploy/step.sh debian "Installing$missing" sh -c "apt-get update && $install"; then
        echo "Then type: apt-get install --yes$missing" >&2
        exit 1
    fi
fi
