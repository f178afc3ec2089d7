#!/bin/bash
# Headers of very many files: ctsplat info on SERIES series of 330 tiny slices, against find and reading the first 4 KiB
# of each file: scan_speed.sh PHANTOM RAW2CT HEADS CTSPLAT [SERIES]
#
# Warm cache, best of three. Also prints the peak memory, for the whole and for a tenth of it.
set -eu

phantom=$1 raw2ct=$2 heads=$3 ctsplat=$4 n_series=${5:-300}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$phantom" --size 32,32,330 --spacing 7,7,0.7 "$work/head.raw"
mkdir "$work/all"
for ((s = 0; s < n_series; s++)); do
    "$raw2ct" --size 32,32,330 --spacing 7,7,0.7 --series-uid "2.25.9$s" "$work/head.raw" "$work/all/$s"
done
mkdir "$work/tenth"
for ((s = 0; s < n_series; s += 10)); do
    ln -s "$work/all/$s" "$work/tenth/$s"
done

peer()
{
    find "$1" -type f | "$heads"
}

# best COMMAND...: wall ms
best()
{
    local least=999999999 start took
    for _ in 1 2 3; do
        start=$(date +%s%N)
        "$@" >/dev/null 2>&1
        took=$((($(date +%s%N) - start) / 1000000))
        [ $took -ge $least ] || least=$took
    done
    echo $least
}

least=$(best peer "$work/all")
info=$(best "$ctsplat" info "$work/all")
echo "$((n_series * 330)) files: find and 4 KiB of each $least ms, info $info ms, ratio $(echo "scale=2; $info / $least" | bc)"
/usr/bin/time -f "peak memory of all: %M KiB" "$ctsplat" info "$work/all" 2>&1 >/dev/null | tail -n 1
/usr/bin/time -f "peak memory of a tenth: %M KiB" "$ctsplat" info "$work"/tenth/* 2>&1 >/dev/null | tail -n 1
