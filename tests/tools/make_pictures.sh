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
