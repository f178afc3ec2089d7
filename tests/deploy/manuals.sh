#!/bin/sh
# What the manuals of batch and node name is there: manuals.sh SOURCE_ROOT CTSPLAT
set -eu
root=$1 ctsplat=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# same WHAT: a and b are equal
same()
{
    sort -u "$work/a" >"$work/a.sorted"
    sort -u "$work/b" >"$work/b.sorted"
    diff "$work/a.sorted" "$work/b.sorted" >&2 || { echo "FAIL: $1" && exit 1; }
}

settings()
{
    grep -oE 'CTSPLAT_NODE_[A-Z]+' "$1"
}
settings "$root/src/deploy/ctsplat-node" >"$work/a"
[ "$(sort -u "$work/a" | wc -l)" -ge 8 ]
settings "$root/man/ctsplat-node.1" >"$work/b"
same "settings of ctsplat-node (<) and of its manual (>) differ"
# The unit sets the folder, and nobody needs another profile.
settings "$root/src/deploy/node.conf" | cat - "$root/src/deploy/ctsplat-node.service" |
    grep -oE 'CTSPLAT_NODE_[A-Z]+' >"$work/b"
echo CTSPLAT_NODE_PROFILE >>"$work/b"
same "settings of ctsplat-node (<) and of node.conf with the unit (>) differ"

"$ctsplat" batch --help >"$work/help" 2>&1 || exit 77
tr -d '\\' <"$root/man/ctsplat-batch.1" | awk '/^\.SH/ { on = $2 == "OPTIONS" } on' | grep -oE -e '--[a-z-]+' |
    sort -u >"$work/options"
while read -r option; do
    grep -qE -e "^ .*$option( |\$)" "$work/help" || { echo "FAIL: ctsplat-batch(1) has $option, batch --help has not" && exit 1; }
done <"$work/options"
