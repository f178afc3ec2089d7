#!/bin/sh
# Runs one python test in an empty folder: net_runner.sh SCRIPT CTSPLAT LOOPBACK_SO DATA [PROGRAM]
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
script=$(realpath "$1") ctsplat=$(realpath "$2") loopback=$(realpath "$3") data=$(realpath "$4") program=${5:+$(realpath "$5")}
cd "$work"
export OMP_WAIT_POLICY=PASSIVE HOME="$work"
unset XDG_CACHE_HOME CTSPLAT_CREDENTIALS http_proxy https_proxy all_proxy HTTP_PROXY HTTPS_PROXY ALL_PROXY
# Debian's python3 has Debian's pydicom; another one earlier in PATH may not.
python=/usr/bin/python3
[ -x $python ] || python=python3
code=0
"$python" -B "$script" "$ctsplat" "$loopback" "$data" ${program:+"$program"} || code=$?
exit $code
