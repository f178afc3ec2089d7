#!/bin/sh
# Names in the manuals of batch and serve exist: manuals.sh SOURCE_ROOT CTSPLAT
set -eu
root=$1 ctsplat=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# same WHAT: a and b are equal
same()
{
    sort -u "$work/a" >"$work/a.sorted"
    sort -u "$work/b" >"$work/b.sorted"
    diff "$work/a.sorted" "$work/b.sorted" >&2 || { echo "FAIL: $1" && exit 1; }
}

settings()
{
    grep -ohE 'CTSPLAT_BATCH_[A-Z]+' "$@"
}
settings "$root/src/app/deploy/ctsplat-batch.service" >"$work/a"
[ "$(sort -u "$work/a" | wc -l)" -ge 4 ]
settings "$root/src/app/deploy/batch.conf" >"$work/b"
same "settings of ctsplat-batch.service (<) and of batch.conf (>) differ"
settings "$root/man/ctsplat-batch.1" >"$work/b"
same "settings of ctsplat-batch.service (<) and of its manual (>) differ"

# options FILE: those that have an entry in the section OPTIONS of a manual
options()
{
    tr -d '\\' <"$1" | awk '/^\.SH/ { on = $2 == "OPTIONS" } on' | grep -E '^\.BR? ' | grep -oE -e '--[a-z-]+'
}
"$ctsplat" batch --help all >"$work/help" 2>&1 || exit 77
grep -oE '^  (-., |    )--[a-z-]+' "$work/help" | grep -oE -e '--[a-z-]+' >"$work/a"
options "$root/man/ctsplat-batch.1" >"$work/own"
options "$root/man/ctsplat.1" | cat - "$work/own" | grep -Fx -f "$work/a" >"$work/b"
same "batch --help has options (<) that neither ctsplat-batch(1) nor ctsplat(1) has"
cp "$work/own" "$work/a"
grep -oE -e '--[a-z-]+' "$work/help" | grep -Fx -f "$work/own" >"$work/b"
same "ctsplat-batch(1) has options (<) that batch has not"

# The table of the paper's steps in ctsplat-methods(7): each function is in its file.
sed -n '/^\.TS/,/^\.TE/p' "$root/man/ctsplat-methods.7" | grep -E '^[^|]+\|[a-z_/]+\.c\|' >"$work/steps"
[ "$(wc -l <"$work/steps")" -ge 8 ] || { echo "FAIL: the table of the paper's steps is missing" && exit 1; }
while IFS='|' read -r step file function; do
    found=$(ls "$root"/src/*/"$file" 2>/dev/null) || { echo "FAIL: $step: no file $file" && exit 1; }
    [ "${function#(}" != "$function" ] || grep -q "\b$function(" "$found" || { echo "FAIL: $step: no $function in $file" && exit 1; }
done <"$work/steps"

# The same of serve.
"$ctsplat" serve --help all >"$work/help" 2>&1 || exit 77
grep -oE '^  (-., |    )--[a-z-]+' "$work/help" | grep -oE -e '--[a-z-]+' | grep -vx -e --help >"$work/a"
options "$root/man/ctsplat-serve.1" >"$work/own"
options "$root/man/ctsplat.1" | cat - "$work/own" | grep -Fx -f "$work/a" >"$work/b"
same "serve --help has options (<) that neither ctsplat-serve(1) nor ctsplat(1) has"
cp "$work/own" "$work/a"
grep -oE -e '--[a-z-]+' "$work/help" | grep -Fx -f "$work/own" >"$work/b"
same "ctsplat-serve(1) has options (<) that serve --help has not"
