# Values that are no part of a scan: filling around it, and isolated voxels that no scanner measures.

python=/usr/bin/python3
[ -x $python ] || python=python3
$python -c 'import numpy, pydicom' 2>/dev/null || {
    echo "SKIP: numpy or pydicom is missing"
    exit 77
}
set_hu()
{
    folder=$1
    shift
    rm -rf "$folder"
    $python "$root/tests/e2e/hu_edit.py" "$data/phantom" "$folder" "$@" || fail "the series cannot be made: $*"
}
draw='--size 64x64 --preset skin --force'

# quiet FOLDER: a picture, and not a word
quiet()
{
    ok render "$1" $draw -o out.png
    [ ! -s err ] || fail "$1: $(cat err)"
}

# fills NAME HU EXPRESSION EXPECTED: the filling is named, stays without --fill, and is air with it
fills()
{
    name=$1 hu=$2
    set_hu "$name" "$3"
    set_hu expected "$4"
    ok render expected $draw -o expected.png
    ok render "$name" $draw -o plain.png
    has err "^ctsplat: warning: .*exactly $hu HU.*--fill $hu turns them into air"
    ! cmp -s plain.png expected.png || fail "$name: cleared without --fill"
    ok render "$name" $draw -o out.png --fill "$hu" --log log.jsonl
    ! grep -q 'exactly' err || fail "$name: $(cat err)"
    has log.jsonl '"fill_cleared","severity":"note"'
    cmp out.png expected.png || fail "$name: --fill $hu is not the picture with air"
    rm log.jsonl
}
far='(i - 31.5) ** 2 + (j - 31.5) ** 2'
fills round 0 "np.where($far < 900, hu, 0)" "np.where($far < 900, hu, -1024)"
fills round-low -600 "np.where($far < 900, hu, -600)" "np.where($far < 900, hu, -1024)"
fills padded 0 'np.pad(hu[4:-4, 1:-1, 1:-1], ((4, 4), (1, 1), (1, 1)))' \
    'np.pad(hu[4:-4, 1:-1, 1:-1], ((4, 4), (1, 1), (1, 1)), constant_values=-1024)'
fills rotated 100 'np.where(abs(i - 31.5) + abs(j - 31.5) < 44, hu, 100)' \
    'np.where(abs(i - 31.5) + abs(j - 31.5) < 44, hu, -1024)'
# The same value inside, which is not connected to the border, is tissue; info keeps what is stored.
set_hu inside "np.where($far < 900, np.where(($far < 16) & (abs(k - 20) < 8), 0, hu), 0)"
set_hu expected "np.where($far < 900, np.where(($far < 16) & (abs(k - 20) < 8), 0, hu), -1024)"
ok render inside $draw -o out.png --fill 0
ok render expected $draw -o expected.png
cmp out.png expected.png || fail "--fill reaches what is not connected"
ok info inside --json
has out '"constant_fill"'
ok info "$data/phantom" --json
! grep -q constant_fill out || fail "a filling in the phantom"
# That scanner's air, a volume of one value, a body that the field of view cuts: no filling.
set_hu air "np.where($far < 900, hu, -900)"
quiet air
set_hu cut '(hu + rng.normal(0, 8, hu.shape))[:, 20:40, 20:40]'
ok render cut $draw -o out.png
! grep -q 'exactly' err || fail "cut: $(cat err)"
# Two rows that reslicing leaves, and numbers of labels.
set_hu rows 'np.where(j > 61, 0, hu)'
ok render rows $draw -o out.png
! grep -q 'exactly' err || fail "rows: $(cat err)"
set_hu numbers '(hu > 0) * 1.0'
ok render numbers $draw -o out.png
! grep -q 'exactly' err || fail "numbers: $(cat err)"
set_hu side 'np.where(j > 57, 0, hu)'
ok render side $draw -o out.png
has err 'exactly 0 HU'
set_hu single 'hu * 0 + 40'
ok render single $draw -o out.png
! grep -q 'exactly' err || fail "single: $(cat err)"
refused 2 "not a number of HU" render "$data/phantom" $draw -o out.png --fill none

# Isolated voxels beyond all Hounsfield units: the others' picture; of the high ones the largest other value.
slope='RescaleSlope=20'
at='(k == 20) & (j == 30)'
set_hu plain 'np.rint(hu / 20)' "$slope"
ok render plain $draw -o plain.png
set_hu high "np.where($at & (i == 30), 32000, np.rint(hu / 20))" "$slope"
set_hu expected "np.where($at & (i == 30), np.rint(hu / 20).max(), np.rint(hu / 20))" "$slope"
set_hu low "np.where($at & (i == 30), -32000, np.rint(hu / 20))" "$slope"
ok render expected $draw -o expected.png
ok render high $draw -o out.png
has err '^ctsplat: warning: 1 isolated voxel holds .* to 640000 HU.* 0 low .* 1 high as 2920 HU'
cmp out.png expected.png || fail "a high voxel is not the largest other value"
ok info high --json
has out '"hu_max": *2920\b'
ok render low $draw -o out.png
has err '^ctsplat: warning: 1 isolated voxel holds .* from -640000 to 2920 HU.* 1 low count as -1024'
set_hu many 'np.where((i % 16 == 0) & (j % 16 == 0), 32000, np.rint(hu / 20))' "$slope"
refused 4 'its values from -1000 to 640000 are no Hounsfield units' render many $draw -o out.png
set_hu large "np.where(abs(k - 20) + abs(j - 30) + abs(i - 30) < 3, 32000, np.rint(hu / 20))" "$slope"
refused 4 "no Hounsfield" render large $draw -o out.png
# An extended scale stays.
set_hu extended "np.where($at & (i == 30), 1535, np.rint(hu / 20))" "$slope"
quiet extended
