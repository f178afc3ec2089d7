#!/bin/sh
# Runs one script of tests/cli or tests/e2e in an empty folder: run.sh SOURCE_ROOT CTSPLAT SCRIPT
#
# The script knows $ctsplat, $root, $data (testdata/) and $engines (what this build has), and these:
#   ok ARGS...                   runs ctsplat, which must exit with 0; its output is in out, its messages in err
#   refused CODE PATTERN ARGS... it must exit with CODE, print nothing, and say one error line that matches PATTERN
#   fail WORDS...                the script fails, with these words
#   has FILE PATTERN             FILE has a line that matches the extended regular expression
#   py SCRIPT ARGS...            a python script beside the shell script, with numpy (none: a skip); must exit with 0
set -u

root=$(realpath "$1") ctsplat=$(realpath "$2") script=$(realpath "$3")
data=$root/testdata
engines='classic tiled raycast'
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
# Debian's python3 comes first: it has Debian's numpy, and starts in a tenth of the time of a version manager's.
export XDG_CONFIG_HOME="$work/config" HOME="$work" PATH="/usr/bin:$PATH"
unset SOURCE_DATE_EPOCH

fail()
{
    echo "FAIL: $*" >&2
    echo "last command: ${last:-none}" >&2
    sed 's/^/  err: /' err >&2 2>/dev/null
    exit 1
}

run()
{
    last=$*
    code=0
    "$ctsplat" "$@" >out 2>err </dev/null || code=$?
}

ok()
{
    run "$@"
    [ "$code" = 0 ] || fail "exit code $code, expected 0"
}

refused()
{
    expected=$1 pattern=$2
    shift 2
    run "$@"
    [ "$code" = "$expected" ] || fail "exit code $code, expected $expected"
    [ ! -s out ] || fail "a refusal prints something: $(head -c 200 out)"
    errors=0
    while IFS= read -r line || [ -n "$line" ]; do
        case $line in
            'ctsplat: error: '*) errors=$((errors + 1)) reported=$line ;;
            'ctsplat: warning: '*) ;;
            *) fail "lines that are neither error nor warning" ;;
        esac
    done <err
    [ $errors = 1 ] || fail "not exactly one error line"
    printf '%s\n' "$reported" | grep -qE -e "$pattern" || fail "the error does not match: $pattern"
}

has()
{
    grep -qE -e "$2" "$1" || fail "$1 has no line that matches: $2"
}

py()
{
    python3 -c 'import numpy' 2>/dev/null || exit 77
    name=$1
    shift
    python3 -B "${script%/*}/$name" "$@" || fail "$name $*"
}

: >err
. "$script"
