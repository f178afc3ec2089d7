#!/bin/sh
# testdata/ is what its maker makes, byte for byte: testdata.sh SOURCE_ROOT PHANTOM RAW2CT MAKE_ZIP
set -eu

root=$1 phantom=$2 raw2ct=$3 make_zip=$4
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$root/tests/tools/make_testdata.sh" "$phantom" "$raw2ct" "$make_zip" "$work/testdata"
diff -r --exclude=README.md "$root/testdata" "$work/testdata"
