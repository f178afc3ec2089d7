#!/bin/sh
# Makes man/gallery.md's pictures from testdata's phantom: make_pictures.sh CTSPLAT, of a build folder. README.md's are
# made by make_real_pictures.sh.
set -eu

cd "$(dirname "$0")/../.."
ctsplat=$1

# The gallery's pictures, with their options; 8 bits are enough for a page.
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
gallery()
{
    name=$1
    shift
    "$ctsplat" render testdata/phantom --size 200x176 --mm-per-pixel 1.25 "$@" -o "$scratch/$name.dcm"
    dcm2pnm --write-png --nointerlace --meta-none "$scratch/$name.dcm" "man/gallery-$name.png"
}

gallery bone --preset bone --annotate orientation,scale
gallery skin --preset skin --view 30,15
gallery muscle --preset muscle --view left
gallery metal --preset metal --view head
gallery window --preset bone-window
gallery crop --preset bone --view 60,30 --crop -110,110,-110,110,-110,40
gallery unlit --preset bone --shade off
gallery white --preset skin --view right --background '#ffffff'
