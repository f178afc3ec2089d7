#!/bin/sh
# Unused additions: functions of the SIMD libraries, the check suite's tables of cases, formats of pictures; and SIMD
# paths that the build does not offer: unreferenced.sh SOURCE_ROOT CORE_LIBRARY SIMD_LIBRARY...
set -eu
root=$1 core=$2
shift 2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
nm -P "$core" 2>/dev/null | awk '$2 == "U" { print $1 }' | sort -u >"$work/used"
{
    nm -g --defined-only -P "$@" 2>/dev/null | awk '$2 == "T" { print $1 }'
    nm -g --defined-only -P "$core" 2>/dev/null | awk '$2 ~ /^[DR]$/ && $1 ~ /^cts_(check|format)_/ { print $1 }'
} | sort -u >"$work/made"
[ "$(wc -l <"$work/made")" -gt 10 ] || { echo 'unreferenced.sh is blind'; exit 1; }
comm -23 "$work/made" "$work/used" | sed 's/$/ is used by nothing/' >"$work/left"
paths=$(grep -o 'path([A-Z0-9]*' "$root/src/base/cpu.h" | sed 's/path(//' | tr 'A-Z' 'a-z')
[ -n "$paths" ] || { echo 'unreferenced.sh sees no SIMD path'; exit 1; }
for path in $paths; do
    [ "$(grep "^option('simd'" "$root/meson_options.txt" | grep -o "'$path'" | wc -l)" = 2 ] ||
        echo "SIMD path $path: not among the choices of meson_options.txt and their default" >>"$work/left"
    [ "$(grep -c "^ *'$path': " "$root/src/meson.build")" -ge 1 ] && grep -q "^simd_sources.*'$path'" "$root/src/meson.build" ||
        echo "SIMD path $path: without sources or compiler flags in src/meson.build" >>"$work/left"
done
cat "$work/left"
[ ! -s "$work/left" ]
