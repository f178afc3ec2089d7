#!/bin/sh
# The tiled engine's benchmark on a phantom of 512 x 512 x 324 voxels, or on the series in FOLDER:
# tiled_speed.sh TILED_SPEED PHANTOM RAW2CT [FOLDER]. Needs 400 MB in the temporary folder for the phantom.
set -eu

program=$1 phantom=$2 raw2ct=$3 folder=${4:-}
if [ -z "$folder" ]; then
    folder=$(mktemp -d)
    trap 'rm -rf "$folder"' EXIT
    "$(dirname "$0")/head_series.sh" "$phantom" "$raw2ct" "$folder/series"
fi
"$program" "$folder"
