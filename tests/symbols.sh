#!/bin/sh
# Linker symbols begin with cts_, and with cli_ in the program's own files: symbols.sh PROGRAM LIBRARY... C++ names are
# checked by the function's own name; symbols that only C++ emits (tables, templates) are not.
set -eu

# outside PREFIX FILE...: external symbols defined in these files whose names begin with something else
outside()
{
    prefix=$1
    shift
    nm -g --defined-only -P "$@" 2>/dev/null | awk -v prefix="$prefix" '
        NF < 3 || $2 !~ /^[TDBRGSC]$/ || $1 == "main" || $1 ~ /^(DW\.ref\.|\.gomp_critical_user_cts_)/ { next }
        { own = $1; sub(/^_Z[0-9]+/, "", own) }
        index(own, prefix) != 1 { print $1 }'
}

program=$1
shift
for file in "$@" "$program".p; do
    [ -e "$file" ] || { echo "symbols.sh: no $file"; exit 1; }
done
found=$(outside cts_ "$@"; outside cli_ "$program".p/*.o)
[ -z "$found" ] || {
    printf 'external symbols that do not begin with cts_ (cli_ in src/cli):\n%s\n' "$found"
    exit 1
}
# It must see something.
[ -n "$(outside no_such_prefix "$1")" ] && [ -n "$(outside no_such_prefix "$program".p/*.o)" ] || {
    echo 'symbols.sh is blind'
    exit 1
}
