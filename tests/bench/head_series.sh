#!/bin/sh
# The phantom of a head as a DICOM series of SLICES (324) uncompressed slices of 512 x 512 in the new FOLDER:
# head_series.sh PHANTOM RAW2CT FOLDER [SLICES]. Takes 400 MB beside it for a moment, 170 MB for good.
set -eu

phantom=$1 raw2ct=$2 folder=$3 slices=${4:-324}
"$phantom" --size "512,512,$slices" --spacing 0.478,0.478,0.497 "$folder.raw"
"$raw2ct" --size "512,512,$slices" --spacing 0.478,0.478,0.497 "$folder.raw" "$folder" >/dev/null
rm "$folder.raw"
