#!/bin/sh
# The files that `meson install` gives to C callers: library.sh SOURCE_ROOT BUILD_ROOT CTSPLAT CC SANITIZER. The example
# is built and run against the installed tree alone, and renders the same picture as the program.
set -eu

root=$1 build=$2 ctsplat=$3 cc=$4
case $ctsplat in /*) ;; *) ctsplat=$PWD/$ctsplat ;; esac
command -v pkg-config >/dev/null || exit 77
[ "$5" = none ] || { echo "skip: a library with sanitizers links with their run-time alone"; exit 77; }

fail()
{
    echo "FAIL: $*" >&2
    exit 1
}

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
DESTDIR=$work/tree meson install -C "$build" --no-rebuild --quiet
cd "$work"
pc=$(find tree -name ctsplat.pc)
[ -n "$pc" ] || fail "no pkg-config file is installed"
export PKG_CONFIG_LIBDIR="${pc%/*}" PKG_CONFIG_SYSROOT_DIR="$work/tree"
flags=$(pkg-config --cflags --libs ctsplat)
library=$(find tree -name libctsplat.so)
[ -n "$library" ] || fail "no shared library is installed"
[ -z "$(find tree -name '*.a')" ] || fail "a static library is installed"

# The library exports only cts_ symbols: all that the headers declare, and no others.
nm -D --defined-only "$library" | awk '{ print $NF }' | sed 's/@.*//' | grep -v '^_init$\|^_fini$' | LC_ALL=C sort -u >exported
cat tree/*/*/include/ctsplat/*.h tree/*/include/ctsplat/*.h 2>/dev/null | sed 's|/\*.*\*/||' |
    grep -v 'static inline' | grep -oE '(^|[ *])cts_[a-z0-9_]+(\(|\[)' | tr -d ' *([' | LC_ALL=C sort -u >declared
[ -s declared ] || fail "no headers are installed"
LC_ALL=C comm -23 exported declared >surplus
[ ! -s surplus ] || fail "exported, but no header declares it: $(head -5 surplus | tr '\n' ' ')"
grep -vE '^cts_volume_hu$' declared | while read -r name; do
    grep -qx "$name" exported || echo "$name"
done >missing
[ ! -s missing ] || fail "declared, but not exported: $(tr '\n' ' ' <missing)"
! grep -rnE -e '--[a-z]' -e 'exit code' tree/*/*/include/ctsplat tree/*/include/ctsplat 2>/dev/null ||
    fail "a public header speaks of the command line"

# Each function has its page, made from the header that declares it.
pages=$(dirname "$(find tree -name cts_options_run.3)")
while read -r name; do
    [ -e "$pages/$name.3" ] || grep -q "$name\[" "$root"/include/ctsplat/*.h || echo "$name"
done <declared >missing
grep -vx cts_volume_hu missing >unpaged || true
[ ! -s unpaged ] || fail "without a manual page: $(tr '\n' ' ' <unpaged)"
if command -v groff >/dev/null; then
    for page in "$pages"/ctsplat*.3; do
        [ -z "$(groff -man -ww -Tutf8 -z "$page" 2>&1)" ] || fail "$page: $(groff -man -ww -Tutf8 -z "$page" 2>&1)"
    done
    groff -man -Tutf8 "$pages/ctsplat-job.3" | grep -q 'CtsStatus cts_options_run(' || fail "a page lacks its function"
fi

# Users of the library may be strict, and may write C++.
# shellcheck disable=SC2086
$cc -std=c11 -Wall -Wextra -Wpedantic -Werror "$root/man/example.c" -o example $flags
[ "$(sed '1,/^int main/d' "$root/man/example.c" | wc -l)" -le 25 ] || fail "the example grows"
export LD_LIBRARY_PATH="${library%/*}"
unset CTSPLAT_LIBEXEC # programs are found where they are installed
for series in "$root/testdata/geometry/uneven" "$root/testdata/syntax/jpeg-2000" "$root/testdata/phantom"; do
    ./example "$series" mine.png
    "$ctsplat" render "$series" -o theirs.png --force --log log
    cmp mine.png theirs.png || fail "the library's picture of $series is not the program's"
done
grep -q slices_moved log || fail "no layers were made between slices"
if ./example no-such-folder x.png 2>err; then
    fail "a folder that is not there is rendered"
fi
grep -q no-such-folder err || fail "the example's error does not name no-such-folder"

# The program starts without DCMTK and the network, and finds their programs where they are installed: nothing listens on
# port 9.
program=$(find tree -name ctsplat -path '*/bin/*')
if command -v readelf >/dev/null; then
    ! readelf -d "$program" "$library" | grep -E 'NEEDED.*lib(curl|dcm|openjp|zip)' ||
        fail "the network or a codec is loaded at the start"
fi
for peer in http://127.0.0.1:9 NOBODY@127.0.0.1:9; do
    if "$program" render --from $peer --study-uid 1.2.3 -o x.png 2>err; then
        fail "$peer is no PACS"
    fi
    grep -qE 'connection failed|no association' err || fail "$peer: $(cat err)"
done
rm "$(find tree -name ctsplat-net)"
"$program" render --from http://127.0.0.1:9 --study-uid 1.2.3 -o x.png 2>err || [ $? = 1 ] || fail "exit code without it"
grep -q 'ctsplat-net is not where it was installed' err || fail "without it: $(cat err)"

# A plain series needs no ctsplat-pixels; compressed captures and series do.
rm "$(find tree -name ctsplat-pixels)"
"$program" render "$root/testdata/phantom" -o plain.png -o plain.dcm
cmp plain.png theirs.png || fail "without ctsplat-pixels the picture is another"
for words in "$root/testdata/phantom -o x.dcm --compress rle" "$root/testdata/syntax/jpeg-2000 -o x.png"; do
    # shellcheck disable=SC2086
    "$program" render $words 2>err && fail "compressed pixels without their program"
    grep -q 'ctsplat-pixels is not where it was installed' err || fail "without ctsplat-pixels: $(cat err)"
done
