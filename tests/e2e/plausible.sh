# Faults that only the pixels reveal: values that are no HU, exchanged slices, lengths in other units. Each case is the
# phantom with a few attributes changed.
command -v python3 >/dev/null || exit 77

# case_of FILES CHANGE...: a fresh copy of the phantom in folder c, changed
case_of()
{
    files=$1
    shift
    rm -rf c
    cp -r "$data/phantom" c
    (cd c && python3 "$root/tests/e2e/dicom_edit.py" $files -- "$@") || fail "the case cannot be made"
}

# reported CODE PATTERN: the diagnostic is reported by info and by render, once
reported()
{
    ok info c --json
    [ "$(grep -o "\"code\": *\"$1\"" out | wc -l)" = 1 ] || fail "expected $1 once in the output of info: $(grep -o '"code[^,]*' out)"
    [ "$(grep -o '"code"' out | wc -l)" = 1 ] || fail "expected one code in the output of info: $(grep -o '"code[^,]*' out)"
    ok render c --size 32x32 -o out.png --force
    has err "^ctsplat: warning: .*($2)"
}

quiet()
{
    ok info c --json
    ! grep -q '"code"' out || fail "a word of what is right: $(grep -o '"code[^,]*' out)"
}

case_of 'IM*' '0008,0060,CS=CT'
quiet
for k in 0001 0002 0024 0047 0048; do
    case_of "IM$k.dcm" '0028,1052,DS=-1024'
    reported slice_off_neighbours "IM$k.dcm: differs by .* HU"
done
case_of 'IM0024.dcm' '0028,1052,DS=30'
reported slice_off_neighbours 'IM0024.dcm: differs by 30 HU'
case_of 'IM0024.dcm' '0028,1053,DS=2'
reported slice_off_neighbours 'IM0024.dcm: differs by .* HU'
case_of 'IM0024.dcm' '0028,1053,DS=0.5'
ok info c --json
has out slice_off_neighbours
case_of 'IM*' '0028,1052,DS=1024'
reported hu_implausible 'no air: what surrounds the body has 24 HU'

place='0020,0032,DS=-110.25\-110.25'
case_of 'IM*' "$place\\{4.5 * [k, 47 - k][k in (20, 27)]}" '0020,0013,IS='
reported order_conflict 'IM0021.dcm|IM0028.dcm'
case_of 'IM*' "$place\\{4.5 * [k, 41 - k][k in (20, 21)]}" '0020,0013,IS='
reported order_conflict 'IM0021.dcm|IM0022.dcm'
case_of 'IM*' "$place\\{-4.5 * k}" '0020,0013,IS={k}'
quiet

case_of 'IM*' '0028,0030,DS=0.0035\0.0035' '0020,0032,DS=0\0\{0.0045 * k}'
reported spacing_implausible 'in metres'
case_of 'IM*' '0028,0030,DS=0.35\0.35' '0020,0032,DS=0\0\{0.6 * k}'
reported spacing_implausible 'in centimetres'
case_of 'IM*' '0020,0032,DS=0\0\{0.001 * k}'
reported spacing_implausible 'positions .* in metres'
case_of 'IM*' '0028,0030,DS=0.05\0.05' '0020,0032,DS=0\0\{0.05 * k}' # a mouse in a micro-CT
quiet
case_of 'IM*' '0028,0030,DS=0.08\0.08' '0020,0032,DS=0\0\{0.2 * k}' # with thicker slices
quiet
ok render c --size 32x32 -o out.png --force --log log
! grep -q table_remov log || fail "a table under a mouse: $(grep table_remov log)"
has log 'table removal","why":"voxels and size are those of a specimen'
case_of 'IM*' '0028,0030,DS=0.1\0.1' '0020,0032,DS=0\0\{0.01 * k}' # steps of 0.1 mm in centimetres
reported spacing_implausible 'positions .* in centimetres'
# A speck of bone shows nearly nothing by the millimetre.
case_of 'IM*' '0028,0030,DS=0.006\0.006' '0020,0032,DS=0\0\{0.006 * k}'
ok render c --size 32x32 -o out.png --force --preset ct-bones
has err 'nearly all black: .*--opacity-unit voxel'
[ "$(wc -l <err)" = 1 ] || fail "expected one line: $(cat err)"
ok render c --size 32x32 -o out.png --force --preset ct-bones --opacity-unit voxel
[ ! -s err ] || fail "by the voxel: $(cat err)"
