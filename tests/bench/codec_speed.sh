#!/bin/bash
# Compressed series of 120 slices (or SLICES) beside their codecs' own time, and beside gdcm and dcm2niix where those
# are installed: codec_speed.sh PHANTOM RAW2CT CODEC_SPEED CTSPLAT [SLICES]
set -eu

phantom=$1 raw2ct=$2 codec_speed=$3 ctsplat=$4 n_slices=${5:-120}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
size=512,512,$n_slices spacing=0.45,0.45,1.8
"$phantom" --size $size --spacing $spacing "$work/head.raw"

# wall NAME COMMAND...: the best of three
wall()
{
    local name=$1 best=999999999 start took
    shift
    for _ in 1 2 3; do
        rm -rf "$work/out"
        mkdir "$work/out"
        start=$(date +%s%N)
        "$@" >/dev/null 2>&1 || { echo "    $name: does not read it"; return 0; }
        took=$((($(date +%s%N) - start) / 1000000))
        [ $took -ge $best ] || best=$took
    done
    echo "    $name: $best ms"
}

gdcm_all()
{
    find "$1" -type f -print0 | xargs -0 -P "$(nproc)" -I{} sh -c 'gdcmconv --raw "$1" "$2/$(basename "$1")"' _ {} "$work/out"
}

for syntax in jpeg-2000 jpeg-lossless jpeg-ls rle deflated; do
    "$raw2ct" --size $size --spacing $spacing --bits-stored 12 --unsigned --intercept -1024 \
        --syntax $syntax "$work/head.raw" "$work/$syntax"
    [ $syntax = deflated ] || "$codec_speed" "$work/$syntax" "$(nproc)"
    wall "ctsplat info" "$ctsplat" info "$work/$syntax"
    ! command -v gdcmconv >/dev/null || wall gdcmconv gdcm_all "$work/$syntax"
    ! command -v dcm2niix >/dev/null || wall dcm2niix dcm2niix -b n -o "$work/out" "$work/$syntax"
    rm -r "${work:?}/$syntax"
done
