#!/bin/sh
# Makes the pictures of README.md and man/gallery.md from testdata's phantom: make_pictures.sh CTSPLAT
set -eu

cd "$(dirname "$0")/../.."
ctsplat=$1

# picture NAME OPTION...
picture()
{
    name=$1
    shift
    "$ctsplat" render testdata/phantom --size 320x280 --mm-per-pixel 0.78 "$@" --force -o "man/$name.png"
}

picture phantom-bone --preset bone --view 20,8

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

gallery bone --preset bone --annotate orientation,scale
gallery skin --preset skin --view 30,15
gallery muscle --preset muscle --view left
gallery metal --preset metal --view head
gallery window --preset bone-window
gallery crop --preset bone --view 60,30 --crop -110,110,-110,110,-110,40
gallery unlit --preset bone --shade off
gallery white --preset skin --view right --background '#ffffff'
