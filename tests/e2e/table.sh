# Table removal on real series, if available: the table is removed, the patient is kept, without a doubtful part.

shared=$root/../shared/data
[ -d "$shared/chest-ge" ] || {
    echo "SKIP: the shared samples are not here"
    exit 77
}

# goes SERIES LEAST MOST: cm3 of dense voxels removed
goes()
{
    ok render "$shared/$1" --size 64x64 -o out.png --force --log log.jsonl
    grep '"table_removed"' log.jsonl >line || fail "$1: nothing goes"
    ! grep -q table_removal_uncertain log.jsonl || fail "$1: in doubt"
    grep -q '"event":"table".*"lost_percent":0\(\.0[0-9]*\)\?}' log.jsonl || fail "$1: 0.1 % of the body is lost"
    cm3=$(sed 's/.*removed (\([0-9]*\)\..*/\1/' line)
    [ "$cm3" -ge "$2" ] && [ "$cm3" -le "$3" ] || fail "$1: $cm3 cm3 go, not $2 to $3"
    rm log.jsonl
}

# The GE table, its cradle and the mattress's cover are 950 cm3, by hand; the skull's tray is 180, the holder's shells 75: no tenth may stay.
goes chest-ge 900 980
goes head-phantom/S2020 170 190
goes head-tilt-ge 74 80

# Sanitizers have checked this code already, in test_table too.
[ "$CTS_SANITIZE" = none ] || exit 0

# Room air above -930 HU, as with cone beams: the same is removed, at every second pixel.
python=/usr/bin/python3
[ -x $python ] || python=python3
$python -c 'import numpy, pydicom' 2>/dev/null || exit 0
coarse='PixelSpacing=[2 * float(a) for a in d.PixelSpacing]'
chest=$shared/chest-ge
shared=.
set_hu()
{
    rm -rf edited
    $python "$root/tests/e2e/hu_edit.py" "$chest" edited "$@" || fail "the series cannot be made: $*"
}
set_hu 'np.maximum(hu[:, ::2, ::2], -867)' "$coarse"
goes edited 900 1000
set_hu 'np.where(hu < 0, hu * 0.76, hu)[:, ::2, ::2] + rng.normal(0, 40, (100, 256, 256))' "$coarse"
goes edited 950 1100
# No level of air: in doubt, in one line.
set_hu 'np.where(hu < -600, -900 + i + rng.normal(0, 20, hu.shape), hu)[:, ::2, ::2]' "$coarse"
ok render edited --size 64x64 -o out.png --force
has err '^ctsplat: warning: .*the air around the body is as dense as lungs'
[ "$(grep -vc "the noise of soft tissue" err)" = 1 ] || fail "more than a line: $(cat err)"
# Lungs that the field of view cuts are no room air, and no doubt.
set_hu 'hu[:, 150:320, 150:370]' \
    'ImagePositionPatient=[float(a) for a in np.array(d.ImagePositionPatient, float) + [134.8, 134.8, 0]]'
ok render edited --size 64x64 -o out.png --force
! grep -v "the noise of soft tissue" err || fail "cropped lungs: $(cat err)"
