#!/bin/sh
# The conformance statement names every transfer syntax and class of the source, and every attribute of what is written:
# conformance.sh SOURCE_ROOT CTSPLAT PAGE HTML
set -eu
root=$1 ctsplat=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
command -v dcmdump >/dev/null || exit 77

# The page must name: UIDs in the source's tables, DCMTK's names of others, keywords of written attributes.
grep -ohE '"1\.2\.840\.10008\.[0-9.]+"' "$root"/src/dicom/protocol/syntax.c "$root"/src/dicom/reader/dcmtk_slice.cc \
    "$root"/src/output/export/sc.c "$root"/src/dicom/objects/*.[ch] "$root"/src/dicom/net/net.c | tr -d '"' | grep -vx '1\.2\.840\.10008\.' >"$work/words"
grep -ohE 'UID_[A-Za-z0-9_]+(Storage|Syntax|Model)\b' "$root"/src/dicom/net/dcmtk_dimse.* |
    sed 's/^UID_//' >>"$work/words"
echo VerificationSOPClass >>"$work/words"
"$ctsplat" render "$root/testdata/phantom" --size 32x32 -o "$work/one.dcm" --write-state "$work/state.dcm" 2>/dev/null
"$ctsplat" render "$root/testdata/phantom" --size 32x32 --rotation 2 -o "$work/turn.dcm" 2>/dev/null
"$ctsplat" render "$root/testdata/phantom" --size 32x32 --mode mip -o "$work/grey.dcm" 2>/dev/null
for file in one turn grey state; do
    dcmdump +L "$work/$file.dcm" 2>/dev/null | grep -E '^ *\((00[0-68-9a-f]|2|5|7)' | sed 's/.* //'
done | grep -E '^[A-Z]' | grep -vE 'Item$|ItemTag|DelimitationItem|Unknown|Private|GroupLength' | sort -u >"$work/keywords"
[ "$(wc -l <"$work/keywords")" -gt 100 ] || { echo "FAIL: too few attributes are found" && exit 1; }
cat "$work/keywords" >>"$work/words"

for page in "$3" "$4"; do
    tr -d '\\' <"$page" >"$work/page"
    sort -u "$work/words" | while read -r word; do
        grep -qE "(^|[^A-Za-z0-9.])$(printf '%s' "$word" | sed 's/\./\\./g')([^A-Za-z0-9.]|\.?\$|\. )" "$work/page" || echo "$word"
    done >"$work/missing"
    [ ! -s "$work/missing" ] || { echo "FAIL: $page does not name: $(tr '\n' ' ' <"$work/missing")" && exit 1; }
done
