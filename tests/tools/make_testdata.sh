#!/bin/sh
# Makes everything in testdata/ but its README: make_testdata.sh PHANTOM RAW2CT MAKE_ZIP FOLDER
# PHANTOM, RAW2CT and MAKE_ZIP are programs built from this folder. The same bytes come out every time.
set -eu

phantom=$1 raw2ct=$2 make_zip=$3 out=$4
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir -p "$out"

# The head that pictures are made from.
$phantom --size 64,64,48 --spacing 3.5,3.5,4.5 "$work/head.raw"
$raw2ct --size 64,64,48 --spacing 3.5,3.5,4.5 --description phantom "$work/head.raw" "$out/phantom"

# A coarse one for the odd series: no two sizes and no two spacings are the same.
size=28,24,10 spacing=8,9,9.5
$phantom --size $size --spacing $spacing "$work/small.raw"

# small FOLDER OPTION...: the coarse head with options
small()
{
    folder=$out/$1
    shift
    mkdir -p "${folder%/*}"
    $raw2ct --size $size --spacing $spacing "$@" "$work/small.raw" "$folder"
}

for syntax in implicit explicit big deflated rle jpeg-lossless jpeg-ls jpeg-2000; do
    small "syntax/$syntax" --syntax $syntax --description "syntax $syntax"
done

small pixels/signed-12-junk --bits-stored 12 --slope 2 --junk --description 'signed 12 bits'
small pixels/signed-12-rle --bits-stored 12 --slope 2 --syntax rle --description 'signed 12 bits, RLE'
small pixels/unsigned-12 --bits-stored 12 --unsigned --intercept -1024 --description 'unsigned 12 bits'
small pixels/unsigned-high --bits-stored 12 --high-bit 15 --unsigned --intercept -1024 --description 'left-justified'
small pixels/unsigned-12-jpeg-ls --bits-stored 12 --unsigned --intercept -1024 --syntax jpeg-ls \
    --description 'unsigned 12 bits, JPEG-LS'
small pixels/unsigned-12-jpeg-lossless --bits-stored 12 --unsigned --intercept -1024 --syntax jpeg-lossless \
    --description 'unsigned 12 bits, JPEG lossless'
small pixels/unsigned-12-jpeg-2000 --bits-stored 12 --unsigned --intercept -1024 --syntax jpeg-2000 \
    --description 'unsigned 12 bits, JPEG 2000'
small pixels/fractional-slope --slope 0.5 --intercept -1024 --description 'slope one half'
small pixels/odd-slope --slope 1.75 --intercept -1000.25 --description 'slope 1.75'
small pixels/slope-per-slice --slope 1,2,0.5,1 --intercept 0,-1024,-1000 --description 'slope of each slice'
small pixels/padding --padding -2000 --pad-circle --description 'padding -2000'
small pixels/padding-range --padding -3000,-1500 --pad-circle --description 'padding -3000 to -1500'
small pixels/padding-unsigned --padding 63536 --pad-circle --unsigned --intercept -1024 \
    --description 'padding 63536, unsigned'

small geometry/coronal --orientation coronal --description coronal
small geometry/sagittal --orientation sagittal --description sagittal
small geometry/oblique --orientation 0.8,0.36,0.48,-0.6,0.48,0.64 --description oblique
small geometry/feet-first --flip yz --orientation 1,0,0,0,-1,0 --description 'normal to the feet'
small geometry/far-origin --origin 1000.5,-2000.25,3000.125 --description 'origin far away'
small geometry/missing-slice --skip 4 --description 'one slice missing'
small geometry/many-missing --skip 3,4,6 --description 'three slices missing'
small geometry/uneven --positions 0,5,10,15,20,35,50,65,80,95 --description '5 and 15 mm apart'
small geometry/one-slice --skip 1,2,3,4,5,6,7,8,9 --description 'one slice'
small geometry/two-slices --skip 2,3,4,5,6,7,8,9 --description 'two slices'
small geometry/same-position --positions 0,0,0,0,0,0,0,0,0,0 --description 'one position'

# A gantry tilted by 20 degrees: the head itself is upright.
$phantom --size $size --spacing $spacing --tilt-deg 20 "$work/tilted.raw"
$raw2ct --size $size --spacing $spacing --tilt-deg 20 --description 'gantry tilt' "$work/tilted.raw" \
    "$out/geometry/tilted"

# The stack twice at the same places, with other pixels the second time, as in a perfusion study.
small geometry/two-phases --series-uid 2.25.2001 --acquisition 1 --description 'two phases'
small geometry/two-phases --series-uid 2.25.2001 --acquisition 2 --slope 1.5 --first-instance 11 \
    --description 'two phases'
small geometry/mixed-patients --series-uid 2.25.2002 --skip 5,6,7,8,9 --description 'two patients'
small geometry/mixed-patients --series-uid 2.25.2002 --skip 0,1,2,3,4 --first-instance 6 --patient-id OTHER \
    --patient Other^Test --description 'two patients'

# A scout that was given the series' UID.
$phantom --size 28,1,24 --spacing 8,200,9 "$work/scout.raw"
small series/localizer --series-uid 2.25.2003 --description 'with a localizer'
$raw2ct --size 28,1,24 --spacing 8,200,9 --orientation coronal --image-type 'ORIGINAL\PRIMARY\LOCALIZER' \
    --series-uid 2.25.2003 --first-instance 11 --description 'with a localizer' "$work/scout.raw" "$out/series/localizer"

# Two series in one folder; the second has fewer slices.
small series/two --series-uid 2.25.2004 --description first --series-number 1
small series/two --series-uid 2.25.2005 --description second --series-number 2 --first-instance 11 --skip 8,9

small broken/truncated --description 'one file cut short'
head -c 2000 "$out/broken/truncated/IM0005.dcm" >"$work/cut"
cp "$work/cut" "$out/broken/truncated/IM0005.dcm"
small broken/strangers --description 'among other files'
printf 'Not an image.\n' >"$out/broken/strangers/notes.txt"
: >"$out/broken/strangers/empty.dcm"
head -c 100 "$out/broken/strangers/IM0001.dcm" >"$out/broken/strangers/stub.dcm"
mkdir -p "$out/broken/none"
printf 'No image in this folder.\n' >"$out/broken/none/notes.txt"

# Seeds for fuzzing: the smallest files of each kind.
fuzz=$out/fuzz
mkdir -p "$fuzz/slice" "$fuzz/scan" "$fuzz/sort" "$fuzz/preset" "$fuzz/zip" "$fuzz/labels"
python3 "$(dirname "$0")/make_labels.py" "$fuzz/labels"
$phantom --size 6,5,2 --spacing 30,40,60 "$work/tiny.raw"
for syntax in implicit explicit big deflated rle jpeg-lossless jpeg-ls jpeg-2000; do
    $raw2ct --size 6,5,2 --spacing 30,40,60 --syntax $syntax --description tiny "$work/tiny.raw" "$work/$syntax"
    cp "$work/$syntax/IM0001.dcm" "$fuzz/slice/$syntax"
done
# a deflated data set of no bytes
meta=$(od -An -t u4 -j 140 -N 4 "$fuzz/slice/deflated" | tr -d ' ')
{
    head -c "$((144 + meta))" "$fuzz/slice/deflated"
    printf '\003\000'
} >"$fuzz/slice/deflated-nothing"
for syntax in implicit explicit big; do
    cp "$fuzz/slice/$syntax" "$fuzz/scan/$syntax"
done
# control characters in UIDs, which DCMTK takes out
LC_ALL=C sed 's/2\.25\.[0-9]/2.25.\f/g' "$fuzz/slice/explicit" >"$fuzz/scan/uid-control"
cp "$work/tiny.raw" "$work/explicit/"
$make_zip "$fuzz/zip/two" "$work/explicit/IM0001.dcm" "$work/explicit/IM0002.dcm" "$work/explicit/tiny.raw"
head -c 480 "$work/small.raw" >"$fuzz/sort/heads"
: >"$work/rows"
for k in 0 1 2 3 4 5 6 7; do # eight slices 1 mm apart: byte 6 is the position, byte 7 the step
    printf "\\0\\0\\0\\0\\0\\0\\20$k\\5\\200\\1\\0\\0\\0\\0\\0\\0" >>"$work/rows"
done
cp "$work/rows" "$fuzz/sort/even"
cat >"$fuzz/preset/json" <<'END'
{ "name": "bone", "window": [100, 2100], "mode": "composite", "unit_distance_mm": 1, "background": "#102030",
  "points": [ {"hu": 150, "rgb": [0.9, 0.6, 0.4], "opacity": 0.0}, {"hu": 900, "rgb": [1, 1, 1], "opacity": 0.7} ],
  "colour_points": [ {"hu": 0, "rgb": [0, 0, 0]}, {"hu": 1000, "rgb": [1, 1, 1]} ],
  "shade": {"ambient": 0.2, "diffuse": 0.8, "specular": 0.3, "power": 20}, "remove_table": true }
END
cat >"$fuzz/preset/vp" <<'END'
1
1
0.9
0.1
0.2
10
4 100 0 1000 1
4 0 1 255 1
8 100 0 0 0 1000 1 1 1
END
cat >"$fuzz/preset/xml" <<'END'
<?xml version="1.0"?>
<MRML><VolumeProperty name="tiny" gradientOpacity="4 0 1 255 1" scalarOpacity="4 100 0 1000 1" specular="0.2"
  interpolation="1" shade="1" ambient="0.1" diffuse="0.9" colorTransfer="8 100 0 0 0 1000 1 1 1" specularPower="10"/>
</MRML>
END
