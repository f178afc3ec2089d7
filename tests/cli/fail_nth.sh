#!/bin/bash
# The n-th call that fails, for every n until none does: fail_nth.sh CTSPLAT SHIM TESTDATA CALL [STEP [DCM_STEP]]
# Whatever fails, the program ends with a picture and exit 0 (it could do without), or with one error line, a code of
# its own, and no output; never by a signal, never with half a file. With a STEP only every so many; a DICOM output has
# a step of its own, since most of the memory that it asks for is its dictionary's, one small piece like the other.
set -u

ctsplat=$1 shim=$2 data=$3 call=$4 all_step=${5:-1} dcm_step=${6:-${5:-1}}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failures=0
export SOURCE_DATE_EPOCH=1000000000

fail()
{
    echo "FAIL $name: $call number $n: $1: $(tail -n 3 "$work/said")"
    failures=$((failures + 1))
}

# A warning excuses what is missing: a file that cannot be read may be left out, and a slice whose decoder is killed
# again and again, but nothing because memory is short.
excused()
{
    [ "$call" != malloc ] && { [ "$call" != kill ] || [ "$name" = killed ]; } && grep -q 'warning' "$work/said"
}

# Each output is whole: the one of a run in which nothing failed.
whole()
{
    local file
    for file in $(ls -A "$work/out"); do
        cmp -s "$work/out/$file" "$work/good/$file" || excused || return 1
    done
}

# run NAME STEP COMMAND...
run()
{
    local name=$1 step=$2 n=1 code errors
    shift 2
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
    # The program itself decodes and inflates nothing that it is given.
    { [ "$call" != fork ] && [ "$call" != kill ]; } || [ "$name" = dcm ] || [ "$name" = annotate ] || [ $n -gt 1 ] || fail "no process of its own for foreign bytes"
}

run info "$all_step" "$ctsplat" info --threads 1 "$data/syntax/jpeg-ls"
run deflated "$all_step" "$ctsplat" info --threads 1 "$data/syntax/deflated"
"$ctsplat" render --size 24x20 "$data/syntax/explicit" --compress rle -o "$work/rle.dcm" || exit 1
run compare "$dcm_step" "$ctsplat" compare "$work/rle.dcm" "$work/rle.dcm"
run render "$all_step" "$ctsplat" render --threads 1 --size 24x20 "$data/syntax/jpeg-2000" -o "$work/out/a.png" \
    -o "$work/out/a.exr"
run annotate "$all_step" "$ctsplat" render --threads 1 --size 64x48 --annotate orientation,scale "$data/syntax/explicit" \
    -o "$work/out/a.png"
if [ "$call" = kill ]; then # and every process after it as well
    CTS_FAIL_ON=1 run killed "$all_step" "$ctsplat" render --threads 1 --size 24x20 "$data/syntax/jpeg-2000" \
        -o "$work/out/a.png"
fi
run dcm "$dcm_step" "$ctsplat" render --threads 1 --size 24x20 "$data/syntax/explicit" -o "$work/out/a.dcm"
compress=("$ctsplat" render --threads 1 --size 24x20 --compress jpeg-2000 "$data/syntax/explicit" -o "$work/out/a.dcm")
run dcm "$dcm_step" "${compress[@]}"
if [ "$call" = getrandom ]; then # a site's key is made once
    XDG_STATE_HOME=$work/state run key 1 sh -c 'rm -rf "$XDG_STATE_HOME"; exec "$@"' sh "$ctsplat" render --threads 1 \
        --size 24x20 "$data/syntax/explicit" --deidentify --log "$work/log" -o "$work/out/a.png"
fi
# The helper's children are waited for by the helper.
[ "$call" != wait4 ] || CTS_FAIL_CHILD=1 run helper 1 "$ctsplat" render --threads 1 --size 24x20 "$data/syntax/jpeg-2000" \
    -o "$work/out/a.png"
# OpenJPEG crashes for want of memory, in a process of its own.
[ "$call" != malloc ] || CTS_FAIL_CHILD=1 run encoder "$all_step" "${compress[@]}"
[ $failures -eq 0 ]
