#!/bin/sh
# Runs one end-to-end test in an empty folder of its own: run.sh TEST CTSPLAT TESTDATA PYTHON ENGINES
#
# A test is a shell script with these words at hand:
#     expect CODE COMMAND...   runs it, its output in the files stdout and stderr; fails unless it exits with CODE
#     says FILE PATTERN        fails unless a line of FILE matches the extended regular expression
#     fail TEXT                ends the test
#     py SCRIPT ARGS...        a python script of this folder, with numpy; without numpy the test is skipped
# and with $ctsplat, $data (the folder of testdata) and $engines (the names of those to try).
set -eu

here=$(CDPATH='' cd -- "$(dirname -- "$0")" && pwd)
test_script=$here/$1.sh
ctsplat=$(realpath "$2")
data=$(realpath "$3")
python=$4
engines=$5
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
# Presets of whoever runs the test must not change it.
export HOME="$work" XDG_CONFIG_HOME="$work/config"

fail()
{
    printf 'FAILED: %s\n' "$*" >&2
    exit 1
}

expect()
{
    expected=$1
    shift
    code=0
    "$@" >stdout 2>stderr </dev/null || code=$?
    if [ "$code" -ne "$expected" ]; then
        cat stdout stderr >&2
        fail "exit $code, not $expected: $*"
    fi
}

says()
{
    grep -qE -e "$2" "$1" || {
        cat "$1" >&2
        fail "$1 does not say: $2"
    }
}

py()
{
    "$python" -c 'import numpy' 2>/dev/null || exit 77
    script=$1
    shift
    "$python" -B "$here/$script" "$@"
}

export PYTHONPATH="$here"
# shellcheck source=/dev/null
. "$test_script"
