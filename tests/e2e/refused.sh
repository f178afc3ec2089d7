# What is no volume is refused: the right exit code, one error line, no output.

# refuse CODE PATTERN PATH...
refuse()
{
    code_wanted=$1 words=$2
    shift 2
    refused "$code_wanted" "$words" render "$@" -o out.png
    [ ! -e out.png ] || fail "a picture of $*"
}

refuse 3 'CT' "$data/broken/none"
refuse 3 'nowhere' "$data/nowhere"
refuse 3 'CT' "$data/broken/strangers/notes.txt"
refuse 4 'slice' "$data/geometry/one-slice"
refuse 4 'position' "$data/geometry/same-position"
refuse 4 'patient' "$data/geometry/mixed-patients"
! grep -qE 'Phantom|PHANTOM|Other|OTHER' err || fail "a patient in a message"
refuse 4 'missing' "$data/geometry/many-missing"
refuse 2 'crop' "$data/phantom" --crop 1000,1001,0,1,0,1
refuse 2 'series' "$data/series/two" --series 1.2.3
