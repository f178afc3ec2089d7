#!/bin/sh
# The tiled engine's benchmark on a phantom of 512 x 512 x 324 voxels, or on the series in FOLDER:
# tiled_speed.sh TILED_SPEED PHANTOM RAW2CT [FOLDER]. Needs 400 MB in the temporary folder for the phantom.
set -eu

program=$1 phantom=$2 raw2ct=$3 folder=${4:-}
if [ -z "$folder" ]; then
    folder=$(mktemp -d)
    trap 'rm -rf "$folder"' EXIT
    "$phantom" --size 512,512,324 --spacing 0.478,0.478,0.497 "$folder/head.raw"
    mkdir "$folder/series"
    "$raw2ct" --size 512,512,324 --spacing 0.478,0.478,0.497 "$folder/head.raw" "$folder/series" >/dev/null
    rm "$folder/head.raw"
fi
"$program" "$folder"
