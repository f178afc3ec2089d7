# Input without a volume is refused: the right exit code, one error line, no output.

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
if command -v python3 >/dev/null; then
    # A cone beam in CT Image Storage: many frames without a place are no single slice that is passed.
    mkdir frames
    cp "$data/phantom/IM0001.dcm" frames
    python3 "$root/tests/e2e/dicom_edit.py" frames/IM0001.dcm -- '0028,0008,IS=48' '0020,0032,DS' '0020,0037,DS' \
        '0028,0030,DS' '0020,0052,UI' '0008,0008,CS=DERIVED\PRIMARY'
    refuse 4 'NumberOfFrames \(0028,0008\) is not 1' frames
    run batch frames -O frames-out --size 32x32
    [ "$code" = 8 ] || fail "a batch of an object of many frames ended with $code"
    grep -q '"status":"refused"' frames-out/batch.jsonl || fail "not refused: $(cat frames-out/batch.jsonl)"
fi
refuse 2 'crop' "$data/phantom" --crop 1000,1001,0,1,0,1
refuse 2 'series' "$data/series/two" --series 1.2.3
