#!/bin/sh
# The paper's tables on a phantom of a head of 512 x 512 x 324 voxels and on what real series lie beside the source:
# paper_table.sh CTSPLAT PHANTOM RAW2CT SOURCE_ROOT. Needs 400 MB in the temporary folder for the phantom.
set -eu

ctsplat=$1 phantom=$2 raw2ct=$3 root=$4
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"$(dirname "$0")/head_series.sh" "$phantom" "$raw2ct" "$folder/series"
for series in "$folder/series" "$root/out/demo/ct-head" "$root/../shared/data/head-phantom/S2020"; do
    [ -d "$series" ] || {
        echo "left out: no $series"
        continue
    }
    for preset in bone skin; do
        for view in anterior left; do
            echo "$preset, $view:"
            "$ctsplat" bench --paper "$series" --preset "$preset" --view "$view"
        done
    done
done
