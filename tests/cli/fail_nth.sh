#!/bin/bash
# The n-th call that fails, for every n until none does: fail_nth.sh CTSPLAT SHIM TESTDATA CALL [STEP]
# Whatever fails, the program ends with a picture and exit 0 (it could do without), or with one error line, a code of
# its own, and no output; never by a signal, never with half a file.
set -u

ctsplat=$1 shim=$2 data=$3 call=$4 step=${5:-1}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failures=0
export SOURCE_DATE_EPOCH=1000000000

fail()
{
    echo "FAIL $name: $call number $n: $1: $(tail -n 3 "$work/said")"
    failures=$((failures + 1))
}

# Each output is whole: the one of a run in which nothing failed; or what was read is warned of.
whole()
{
    local file
    for file in $(ls -A "$work/out"); do
        cmp -s "$work/out/$file" "$work/good/$file" || grep -q 'warning' "$work/said" || return 1
    done
}

# run NAME COMMAND...: with every n
run()
{
    local name=$1 n=1 code errors
    shift
    rm -rf "$work/out" "$work/good"
    mkdir "$work/out"
    "$@" >"$work/said" 2>&1 || { echo "FAIL $name: $(cat "$work/said")"; exit 1; }
    mv "$work/out" "$work/good"
    while :; do
        rm -rf "$work/out" "$work/told"
        mkdir "$work/out"
        timeout -k 5 60 env "LD_PRELOAD=$shim" "CTS_FAIL=$call" "CTS_FAIL_AT=$n" "CTS_FAIL_TOLD=$work/told" "$@" \
            >"$work/said.out" 2>"$work/said"
        code=$?
        [ -e "$work/told" ] || break
        errors=$(grep -c '^ctsplat: error: ' "$work/said")
        if [ $code -gt 130 ] || [ $code -eq 124 ]; then # a signal, or no end
            fail "exit $code"
        elif [ "$errors" -ne $((code != 0)) ]; then
            fail "exit $code with $errors error lines"
        elif ! whole; then
            fail "exit $code leaves something else"
        elif [ $code -eq 0 ] && [ "$(ls -A "$work/out")" != "$(ls -A "$work/good")" ]; then
            fail "exit 0 without its outputs"
        fi
        n=$((n + step))
    done
    echo "$name: $call: $(((n - 1) / step)) calls failed in turn"
}

run info "$ctsplat" info --threads 1 "$data/syntax/jpeg-ls"
run render "$ctsplat" render --threads 1 --size 24x20 "$data/syntax/jpeg-2000" -o "$work/out/a.png" -o "$work/out/a.exr" \
    -o "$work/out/a.dcm"
[ $failures -eq 0 ]
