# One volume is of one patient, one study, one frame of reference and one acquisition; findings about the header's pixel
# attributes. Each case is the phantom with a few attributes changed.

# case_of FILES CHANGE...: a fresh copy of the phantom in folder c, changed
case_of()
{
    files=$1
    shift
    rm -rf c
    cp -r "$data/phantom" c
    (cd c && python3 "$root/tests/e2e/dicom_edit.py" $files -- "$@") || fail "the case cannot be made"
}

# two_values TAG...: refused, with the tag and without values
two_values()
{
    refused 4 "$1" render c --size 32x32 -o refused.png
    ! grep -qE 'VALUE|1999|7\.7' err || fail "a value in a message"
}

# warned CODE PATTERN: a picture, and the finding
warned()
{
    ok render c --size 32x32 -o out.png --force
    has err "^ctsplat: warning: .*($2)"
    ok info c --json
    has out "\"code\": ?\"$1\""
}

quiet()
{
    ok render c --size 32x32 -o out.png --force
    [ ! -s err ] || fail "expected no warning: $(cat err)"
}

command -v python3 >/dev/null || exit 77

case_of 'IM000*' '0010,0020,LO=VALUE'
two_values 'PatientID \(0010,0020\)'
case_of 'IM*' '0010,0021,LO=VALUE{k%2}'
two_values 'IssuerOfPatientID \(0010,0021\)'
case_of 'IM*' '0010,0020,LO=' '0010,0010,PN=VALUE{k%2}' # two bodies, interleaved, without an ID
two_values 'PatientName \(0010,0010\)'
case_of 'IM*' '0010,0030,DA=1999010{k//40}'
two_values 'PatientBirthDate \(0010,0030\)'
case_of 'IM*' '0010,0040,CS={"FM"[k == 7]}'
two_values 'PatientSex \(0010,0040\)'
case_of 'IM*' '0020,000d,UI=7.7.{k%2}'
two_values 'StudyInstanceUID \(0020,000D\)'
case_of 'IM*' '0020,0052,UI=7.7.{k%2}'
two_values 'FrameOfReferenceUID \(0020,0052\)'
python3 -m zipfile -c c.zip c
# An anonymiser gave each slice one of its own: a warning, where all else is one scan, and no object references any.
case_of 'IM*' '0020,0052,UI=7.7.{k+1}'
warned frames_of_reference 'each of its 48 slices has a FrameOfReferenceUID \(0020,0052\) of its own'
refused 4 'frame of reference' render c --size 32x32 -o refused.png --write-state refused.dcm
ok render c --size 32x32 -o own.dcm
! grep -aq '7\.7\.' own.dcm || fail "a capture names a frame of reference"
rm c/IM000[1-9].dcm c/IM00[1-3]*.dcm c/IM004[1-4].dcm c/IM0040.dcm
refused 4 'FrameOfReferenceUID' render c --size 32x32 -o refused.png # 4 of them
for change in '0008,0070,LO={"AB"[k == 7]}' '0020,0052,UI=7.7.{min(k, 40)}' '0018,1000,LO={k}' \
    '0020,0052,UI={["", "7.7." + str(k)][k > 0]}' '0020,0032,DS=0\0\{4.5 * k + (2 if k > 20 else 0)}'; do
    case_of 'IM*' '0020,0052,UI=7.7.{k+1}' "$change"
    two_values 'FrameOfReferenceUID \(0020,0052\)'
done
case_of 'IM*' '0020,0052,UI=7.7.{k%2}'
python3 -m zipfile -c c.zip c
refused 4 'FrameOfReferenceUID' render c.zip --size 32x32 -o refused.png

# Padding and empty parts of a name are no other value; nor is another character set.
case_of 'IM*' '0010,0010,PN={["Ab^C", "Ab^C^^^", "Ab^C ", "Ab^C=="][k%4]}'
quiet
case_of 'IM*' '0008,0005,CS={["ISO_IR 100", "ISO_IR 192"][k%2]}' \
    '0010,0010,PN={["M\xfcller^A", "M\xc3\xbcller^A"][k%2]}'
quiet
case_of 'IM*' '0010,0010,PN={["", "X"][k > 0]}' '0010,0020,LO={["", "X"][k > 0]}' '0010,0021,LO={["", "X"][k > 0]}' \
    '0010,0030,DA={["", "19990101"][k > 0]}' '0010,0040,CS={["", "F"][k > 0]}' '0020,0052,UI={["", "1.2"][k > 0]}'
warned identity_incomplete 'is empty in 1 of 48 slices, and has one value in the others'
[ "$(grep -c 'is empty in 1' err)" = 0 ] || fail "info prints the warning on stderr"
[ "$(grep -o identity_incomplete out | wc -l)" = 6 ] || fail "not one finding for each of six attributes"

case_of 'IM0003.dcm' '0008,0060,CS=MR'
refused 4 'Modality \(0008,0060\) is MR' render c --size 32x32 -o refused.png

case_of 'IM*' '0008,0060,CS=ct' '0028,1054,LO=Hounsfield Unit(s)'
quiet

types='["SUBTRACTION", "IODINE_MAP", "PERFUSION", "MATERIAL", "MAT_SPECIFIC", "ELECTRON_DENSITY"]'
case_of 'IM*' "0008,0008,CS=DERIVED\\PRIMARY\\AXIAL\\{$types[k%6]}"
warned not_hu '48 of 48 slices .* another quantity'
case_of 'IM*' '0028,1054,LO=MGML'
refused 4 'RescaleType \(0028,1054\) is MGML, not HU \(--quantity' render c --size 32x32 -o refused.png
ok info c --json --quantity stored
has out '"quantity": *"stored"' && has out '"unit": *""'
case_of 'IM*' '0008,0008,CS=DERIVED\PRIMARY\AXIAL\VMI'
quiet
case_of 'IM0003.dcm' '0028,0301,CS=YES'
warned burned_in_annotation '1 of 48 slices say that text is burned'
ok render c --size 32x32 -o burned.dcm
[ "$(grep -c burned err)" = 1 ] || fail "expected the burned-in warning once"
refused 4 'BurnedInAnnotation' render c --size 32x32 -o refused.dcm --deidentify

# Orientations that jitter by less than a tenth of a pixel are accepted; larger jitter, or a drift, is refused. The
# phantom has 64 pixels a row, so that 0.0015 rad move the last one by a tenth.
turned() { printf '0020,0037,DS={"%%.9f" %% math.cos(%s)}\\{"%%.9f" %% math.sin(%s)}\\0\\{"%%.9f" %% -math.sin(%s)}\\{"%%.9f" %% math.cos(%s)}\\0' \
    "$1" "$1" "$1" "$1"; }
case_of 'IM*' "$(turned '0.0008 * (-1) ** (k * k // 3)')"
quiet
ok info c --json
has out '"code": *"orientation_jitter"'
has out '"slices": *48'
for turn in '0.0016 * (-1) ** k' '0.001 * (k - 23.5) / 23.5' '0.0005 * (k > 23)'; do
    case_of 'IM*' "$(turned "$turn")"
    refused 4 'differ in size, orientation or pixel spacing' render c --size 32x32 -o refused.png
done

# At repeated positions other attributes separate complete volumes: k of 10 slices each, alternating at every position;
# the second ones are 40 HU brighter.
phases_of()
{
    rm -rf c
    cp -r "$data/geometry/two-phases" c
    (cd c && python3 "$root/tests/e2e/dicom_edit.py" IM* -- '0020,0012,IS=1' '0028,1052,DS={40 * (k // 10)}' '0008,0032,TM=120000' \
        '0008,0033,TM=120000' '0018,1060,DS' '0020,0100,IS' '0018,1210,SH=B30' "$@") || fail "the case cannot be made"
}
phases_of
refused 4 'neither acquisition, tube voltage, .* time separates complete volumes' render c --size 32x32 -o refused.png
for part in '0008,0033,TM=12000{k // 10}' '0008,0033,TM=1200{10 + k}' '0020,9241,FL={40 + 70 * (k // 10)}' \
    '0020,9241,FD={40 + 30 * (k // 10)}' \
    '0020,9153,FD={100.5 * (k // 10)}' '0018,1210,SH={["B30", "B70"][k // 10]}'; do
    phases_of "$part"
    warned acquisitions_parted \
        '(ContentTime|NominalPercentageOfCardiacPhase|NominalCardiacTriggerDelayTime|ConvolutionKernel).* separates 2 volumes'
    ok render c --series "$(sed -n 's/.*"series_uid": *"\([^"]*\)".*/\1/p' out | head -n 1)#2" --size 32x32 -o out.png --force
done
phases_of '0018,1210,SH={["B30", "B70"][k % 10 > 4]}' # no group of which is complete
refused 4 'separates complete volumes' render c --size 32x32 -o refused.png
# One volume whose slices each have a time, a phase or a kernel of their own stays one.
case_of 'IM*' '0008,0033,TM=1200{10 + k}' '0020,9241,FL={k}' '0018,1210,SH=B{k // 24}'
quiet

# Acquisitions whose slices take turns are volumes of their own; those that follow each other are one.
for part in 0020,0012,IS '0018,0060,DS' '0020,0100,IS' '0018,1060,DS'; do
    case_of 'IM*' "$part={80 + k % 2}"
    warned acquisitions_parted '(AcquisitionNumber|KVP|TemporalPosition|TriggerTime).* separates 2 volumes'
    case_of 'IM*' "$part={80 + k // 5 % 2}"
    refused 4 'alternate between values' render c --size 32x32 -o refused.png
done
case_of 'IM*' '0020,0012,IS={k // 20}' '0018,0060,DS={80 + k // 30}'
quiet
case_of 'IM*' '0020,0012,IS={80 + (10 < k < 14)}' # a piece that was scanned again
quiet

case_of 'IM*' '0020,0013,IS={[k, 11 - k][3 < k < 8]}'
warned order_conflict 'InstanceNumber \(0020,0013\) neither rises nor falls'
for number in '{100 - k}' 1 '' '{k // 2}'; do
    case_of 'IM*' "0020,0013,IS=$number"
    quiet
done
case_of 'IM*' '0020,0012,IS={k // 24}' '0020,0013,IS={(k + 24) % 48 + 1}' # the lower half was scanned last
quiet
