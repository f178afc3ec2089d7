#!/bin/sh
# What somebody added and nobody calls: functions of the SIMD libraries, and the check suite's tables of cases.
# forgotten.sh CORE_LIBRARY SIMD_LIBRARY...
set -eu
core=$1
shift
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
nm -P "$core" 2>/dev/null | awk '$2 == "U" { print $1 }' | sort -u >"$work/used"
{
    nm -g --defined-only -P "$@" 2>/dev/null | awk '$2 == "T" { print $1 }'
    nm -g --defined-only -P "$core" 2>/dev/null | awk '$2 ~ /^[DR]$/ && $1 ~ /^cts_check_/ { print $1 }'
} | sort -u >"$work/made"
[ "$(wc -l <"$work/made")" -gt 10 ] || { echo 'forgotten.sh is blind'; exit 1; }
comm -23 "$work/made" "$work/used" | sed 's/$/ is used by nothing/' >"$work/left"
cat "$work/left"
[ ! -s "$work/left" ]
