#!/bin/sh
# systemd's own analysis of the units: unit_security.sh SOURCE_ROOT
set -eu
command -v systemd-analyze >/dev/null || { echo "skip: no systemd-analyze"; exit 77; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for name in batch serve; do
    unit=$work/ctsplat-$name.service
    sed "s#@BINDIR@#/usr/bin#" "$1/src/app/deploy/ctsplat-$name.service" >"$unit"
    systemd-analyze security --offline=true --no-pager "$unit" >"$work/said" 2>&1 || true
    exposure=$(sed -n 's/.*Overall exposure level for .*: \([0-9.]*\) .*/\1/p' "$work/said")
    [ -n "$exposure" ] || { echo "skip: this systemd-analyze does not analyse a file: $(head -n 1 "$work/said")"; exit 77; }
    awk "BEGIN { exit !($exposure < 1.5) }" || { cat "$work/said"; echo "FAIL: $name: exposure $exposure"; exit 1; }
done
