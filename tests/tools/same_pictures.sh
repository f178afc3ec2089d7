#!/bin/bash
# Compares the pictures of two builds, bit for bit: same_pictures.sh OLD_CTSPLAT NEW_CTSPLAT SERIES... A range of
# engines, presets, views, modes, kernels, scales and formats for each series; small pictures, so that a few hundred
# scenes take minutes. Prints each scene that differs and a last line with the count. For changes of structure, which
# must not change a pixel.
set -u
old=$1 new=$2
shift 2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export SOURCE_DATE_EPOCH=0
n=0 differing=0

# scene SERIES ENDING OPTION...
scene()
{
    local series=$1 ending=$2 which
    shift 2
    n=$((n + 1))
    for which in old new; do
        rm -f "$work/$which.$ending"
        "${!which}" render "$series" -o "$work/$which.$ending" "$@" >/dev/null 2>"$work/$which.txt"
        echo "exit $?" >>"$work/$which.txt"
    done
    sed -i "s/old\.$ending/X/g" "$work/old.txt" && sed -i "s/new\.$ending/X/g" "$work/new.txt"
    if [ -f "$work/old.$ending" ] && [ -f "$work/new.$ending" ]; then
        cmp -s "$work/old.$ending" "$work/new.$ending" && return
        # Packed otherwise, and the same to the bit.
        "$new" compare "$work/old.$ending" "$work/new.$ending" >/dev/null && return
    elif [ ! -f "$work/old.$ending" ] && [ ! -f "$work/new.$ending" ]; then
        tail -n 1 "$work/old.txt" | cmp -s - <(tail -n 1 "$work/new.txt") && return
    fi
    differing=$((differing + 1))
    echo "differs: $series .$ending $*"
    diff "$work/old.txt" "$work/new.txt" | head -3
}

for series; do
    for view in anterior 30,20 -70,-35 head 135,0; do
        for preset in bone skin muscle metal ct-aaa ct-air ct-soft-tissue lung-window ct-mip; do
            scene "$series" png -p "$preset" --view "$view" --size 160x128
        done
        for engine in classic layers void combined tiled raycast; do
            scene "$series" exr -p skin --view "$view" --size 96x96 --engine "$engine" --shade off
            scene "$series" png -p bone --view "$view" --size 96x96 --engine "$engine" --background none
        done
        for kernel in gaussian cone bspline cone-paper tent:2; do
            scene "$series" png -p bone --view "$view" --size 96x96 --engine combined --kernel "$kernel"
        done
        for mode in mip minip average; do
            scene "$series" png -p bone --view "$view" --size 160x128 --mode "$mode" --remove-table off
        done
        scene "$series" exr -p bone --view "$view" --size 200x200 --mm-per-pixel 0.2
        scene "$series" png -p skin --view "$view" --size 200x200 --mm-per-pixel 3 --threads 1
        scene "$series" png -p bone --view "$view" --size 120x120 --max-error 0.1
        scene "$series" exr -p skin --view "$view" --size 160x128 --max-error 16
        scene "$series" png -p bone --view "$view" --size 96x96 --engine void --void key
        scene "$series" png -p bone --view "$view" --size 96x96 --engine layers --tolerance 20 --grey-bits 8
        scene "$series" png -p bone --view "$view" --size 96x96 --opacity-unit voxel
        scene "$series" dcm -p skin --view "$view" --size 96x96 --annotate orientation,scale --samples 4
    done
    scene "$series" dcm -p bone --rotation 4 --size 64x64 --compress rle
    scene "$series" dcm -p bone --rotation 3 --size 64x64 --mode mip --compress jpeg-lossless
done
echo "$n scenes, $differing differ"
[ "$n" -gt 0 ] && [ "$differing" = 0 ]
