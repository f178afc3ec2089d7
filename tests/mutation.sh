#!/bin/sh
# Plants each known fault in a build of its own and demands that `ctsplat check` fails, and passes without any:
# mutation.sh SOURCE_ROOT [FAULT...]; takes a minute or two for each. The quick form is tests/unit/test_mutation.c.
set -eu
root=$(cd "$1" && pwd)
shift
[ $# -gt 0 ] || set -- $(sed -n "/^option('mutation'/,\$p" "$root/meson_options.txt" | grep -o "'[a-z0-9-]*'" | tr -d "'" |
    grep -vx -e mutation -e combo | awk '!seen[$0]++')

build=$(mktemp -d)
trap 'rm -rf "$build"' EXIT INT TERM
meson setup "$build" "$root" -Dtests=false -Doptimization=1 >/dev/null
missed=0
for fault; do
    meson configure "$build" -Dmutation="$fault" >/dev/null
    ninja -C "$build" src/cli/ctsplat >"$build/ninja.txt" || {
        echo "$fault: does not build" && grep -m 3 error "$build/ninja.txt"
        exit 1
    }
    status=0
    "$build/src/cli/ctsplat" check >"$build/check.txt" || status=$?
    failed=$(grep -c '^FAIL' "$build/check.txt" || true)
    case $fault,$status in
    none,0) echo "none: all pass" ;;
    none,*) echo "none: $failed cases fail without any fault" && missed=1 ;;
    *,1) echo "$fault: caught by $failed cases" ;;
    *) echo "$fault: NOT CAUGHT (status $status)" && missed=1 ;;
    esac
done
exit $missed
