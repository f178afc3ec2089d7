#!/bin/sh
# Makes README.md's head and trunk from phantoms of 256 x 256 x 256 voxels, and man/gallery.md's pictures from testdata's:
# make_pictures.sh CTSPLAT, of a build folder.
set -eu

cd "$(dirname "$0")/../.."
ctsplat=$1

# The gallery's, with the options that stand below them; 8 bits, as a page needs no more.
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
gallery()
{
    name=$1
    shift
    "$ctsplat" render testdata/phantom --size 200x176 --mm-per-pixel 1.25 "$@" -o "$scratch/$name.dcm"
    dcm2pnm --write-png --nointerlace --meta-none "$scratch/$name.dcm" "man/gallery-$name.png"
}

tools=$(dirname "$ctsplat")/../../tests/tools
"$tools/phantom" --size 256,256,256 --spacing 0.85,0.95,0.85 --soft 1.8 "$scratch/head.raw"
"$tools/raw2ct" --size 256,256,256 --spacing 0.85,0.95,0.85 "$scratch/head.raw" "$scratch/head" >"$scratch/said"
"$ctsplat" render "$scratch/head" -p man/glass.json --view 30,10 --size 1024x800 --annotate orientation,scale --force \
    -o man/head-glass.jpg

"$tools/phantom" --body --labels "$scratch/organs.nii" --size 256,256,256 --spacing 1.7,1.1,1.7 --soft 6 "$scratch/body.raw"
"$tools/raw2ct" --size 256,256,256 --spacing 1.7,1.1,1.7 "$scratch/body.raw" "$scratch/body" >"$scratch/said"
body="$scratch/body --force"
"$ctsplat" render $body --preset bone --view -25,15 --crop -200,200,-150,150,-40,230 --size 1024x640 -o man/chest-bone.jpg
"$ctsplat" render $body --preset muscle --labels "$scratch/organs.nii" --label-names tests/tools/body_labels.json \
    --look man/organs.json --view 25,10 --size 1024x800 --annotate labels -o man/body-organs.jpg

gallery bone --preset bone --annotate orientation,scale
gallery skin --preset skin --view 30,15
gallery muscle --preset muscle --view left
gallery metal --preset metal --view head
gallery window --preset bone-window
gallery crop --preset bone --view 60,30 --crop -110,110,-110,110,-110,40
gallery unlit --preset bone --shade off
gallery white --preset skin --view right --background '#ffffff'
