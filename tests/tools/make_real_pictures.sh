#!/bin/bash
# Renders the pictures of real CT series by the commands in man/recipes.md, and takes the screenshots of page and contact
# sheet: make_real_pictures.sh CTSPLAT [DATA], of a build folder. DATA, ../shared/data by default, contains the series;
# their sources and licences are in man/PICTURES.md. Needs chromium and chromium-driver.
set -eu

cd "$(dirname "$0")/../.."
ctsplat=$(realpath "$1") man=$PWD/man data=$(realpath "${2:-../shared/data}")

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
mkdir "$scratch/scans"
ln -s "$data/chest-ge" "$scratch/scans/chest"
ln -s "$data/head-phantom/S2020" "$scratch/scans/skull"
ln -s "$data/body-j2k" "$scratch/scans/trunk"
ln -s "$data/other/mr-head" "$scratch/scans/brain"
ln -s "$data/other/pet-body" "$scratch/scans/pet"
ln -s "$data/labels/body-j2k/31-organs.nii.gz" "$scratch/scans/organs.nii.gz"
ln -s "$ctsplat" "$scratch/ctsplat"
ln -s "$man/glass.json" "$man/trunk.json" "$scratch"

for name in chest skull trunk mr pet; do
    command=$(sed -n "s|^    \(ctsplat render scans/.* -o $name.jpg\)$|\1|p" man/recipes.md)
    [ -n "$command" ] || { echo "man/recipes.md has no command for $name.jpg" >&2; exit 1; }
    (cd "$scratch" && PATH=$scratch:$PATH sh -c "$command")
done
python=/usr/bin/python3
[ -x $python ] || python=python3
"$python" -B tests/tools/screenshots.py "$ctsplat" "$scratch" "$data/chest-ge" "$data/head-phantom/S2020" "$data/body-j2k"

for name in chest skull trunk mr pet page sheet; do
    # A page is read over networks, and shows pictures at most so wide.
    [ "$(wc -c <"$scratch/$name.jpg")" -lt 250000 ] || { echo "$name.jpg is too large for a page" >&2; exit 1; }
    cp "$scratch/$name.jpg" "$man/$name.jpg"
done

# The gallery's rows of MR and PET: the options below each picture.
paste <(grep -o '(gallery-[a-z-]*\.jpg)' "$man/gallery.md" | tr -d '()') <(grep -o '`-p [^`]*`' "$man/gallery.md" | tr -d '`') |
    while IFS=$'\t' read -r name options; do
        scan=brain
        [[ $name == gallery-mr* ]] || scan=pet
        # shellcheck disable=SC2086
        "$ctsplat" render "$scratch/scans/$scan" $options --size 200x220 -o "$man/$name" --force
    done
