#!/bin/sh
# The paper's table on a phantom of a head of 512 x 512 x 324 voxels and on what real series lie beside the source:
# paper_table.sh PAPER_TABLE PHANTOM RAW2CT SOURCE_ROOT. Needs 400 MB in the temporary folder for the phantom.
set -eu

program=$1 phantom=$2 raw2ct=$3 root=$4
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"$(dirname "$0")/head_series.sh" "$phantom" "$raw2ct" "$folder/series"
set -- "$folder/series"
for series in "$root/out/demo/ct-head" "$root/../shared/data/head-phantom/S2020"; do
    if [ -d "$series" ]; then
        set -- "$@" "$series"
    else
        echo "left out: no $series"
    fi
done
"$program" "$@"
