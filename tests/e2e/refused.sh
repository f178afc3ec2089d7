# What is no volume is refused: the right exit code, exactly one error line, no output.

# refuse CODE PATTERN PATH...
refuse()
{
    code=$1 pattern=$2
    shift 2
    expect "$code" "$ctsplat" render "$@" -o out.png
    [ "$(grep -c '^ctsplat: error: ' stderr)" -eq 1 ] || {
        cat stderr >&2
        fail "not one error line: $*"
    }
    says stderr "^ctsplat: error: .*($pattern)"
    [ ! -e out.png ] || fail "a picture of $*"
}

refuse 3 'CT' "$data/broken/none"
refuse 3 'nowhere' "$data/nowhere"
refuse 3 'CT' "$data/broken/strangers/notes.txt"
refuse 4 'slice' "$data/geometry/one-slice"
refuse 4 'position' "$data/geometry/same-position"
refuse 4 'patient' "$data/geometry/mixed-patients"
refuse 4 'missing' "$data/geometry/many-missing"
refuse 2 'preset' "$data/phantom" -p no-such-preset
refuse 2 'size' "$data/phantom" --size 0x10
refuse 2 'crop' "$data/phantom" --crop 1000,1001,0,1,0,1
refuse 2 'series' "$data/series/two" --series 1.2.3
! grep -q 'Phantom' stderr || fail "a patient name in a message"
