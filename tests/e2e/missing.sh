# Slices missing without a wider gap, detected by their numbers: a warning where every 2nd or 3rd is present, else
# refused; and complete stacks, without a finding. Each case is the phantom (48 slices of 4.5 mm, numbered 1 to 48) with
# a few slices and attributes changed.
command -v python3 >/dev/null || exit 77

# only PYTHON: a fresh copy in folder c of the slices k (from 1) for which this holds
only()
{
    rm -rf c
    mkdir c
    for k in $(python3 -c "print(*(k for k in range(1, 49) if $1))"); do
        cp "$data/phantom/$(printf 'IM%04d.dcm' "$k")" c
    done
}

changed()
{
    (cd c && python3 "$root/tests/e2e/dicom_edit.py" IM* -- "$@") || fail "the case cannot be made"
}

# missing PATTERN: refused; with --allow-missing-slices a picture and a warning
missing()
{
    refused 4 "$1" render c --size 32x32 -o refused.png
    has err 'allow-missing-slices'
    ok render c --size 32x32 -o out.png --force --allow-missing-slices
    has err "^ctsplat: warning: .*($1)"
    run info c --json
    has out '"renderable": *false'
    ok info c --json --allow-missing-slices
    has out '"code": *"missing_slices"'
}

thinned()
{
    ok render c --size 32x32 -o out.png --force
    has err "^ctsplat: warning: .*($1)"
    [ "$(grep -cE "warning: .*($1)" err)" = 1 ] || fail "expected one warning: $(cat err)"
    ok info c --json
    [ "$(grep -o '"missing_slices"' out | wc -l)" = 1 ] || fail "expected missing_slices once in the output of info"
}

quiet()
{
    ok info c --json
    ! grep -q '"missing_slices"' out || fail "expected no missing_slices: $(cat out)"
    ! grep -q '"renderable": *false' out || fail "refused: $(cat out)"
}

only 'k % 2'
thinned 'every 2nd slice .* steps by 2, and slices of 4.5 mm lie 9 mm apart'
only 'k % 3 == 0'
thinned 'every 3rd slice'
changed '0020,0013,IS={100 - 3 * k}'
thinned 'every 3rd slice'
only 'k in (20, 23)'
thinned 'every 3rd slice'
only 'k % 4 == 0'
missing 'every 4th slice'
only 'k % 10 == 1'
missing 'every 10th slice'
only 'k in (1, 3, 6, 8, 11, 12)'
missing '6 of 12 slices missing: InstanceNumber .* from 1 to 3'
only 'k in (2, 48)'
missing 'every 46th slice'
# Two slices 100 mm apart, of 7.5 mm, numbered 2 and 12.
only 'k in (2, 48)'
changed '0018,0050,DS=7.5' '0020,0032,DS=0\0\{100 * k}' '0020,0013,IS={2 + 10 * k}'
missing 'every 10th slice .* slices of 7.5 mm lie 100 mm apart'
# A tenth is no reason to refuse, for any order of numbers.
only 'k != 20'
thinned '1 of 48 slices missing and interpolated'
only 'k not in (20, 21, 22, 30, 31, 32)'
missing '6 of 48 slices missing'

# Thin slices far apart, by protocol.
only 'k % 5 == 0'
changed '0018,0050,DS=1' '0020,0013,IS={1 + k}'
quiet
only 'k % 5 == 0'
changed '0020,0013,IS={7 - k}'
quiet
# Numbers by twos, slices as thick as they lie apart.
only 'k % 2'
changed '0018,0050,DS=9'
quiet
only 'True'
changed '0020,0013,IS={2 * k}'
quiet
# No thickness, no number, one number, numbers in no order: nothing is counted.
for change in '0018,0050,DS' '0018,0050,DS=0' '0020,0013,IS' '0020,0013,IS=1' '0020,0013,IS={k * 7 % 16 * 3}'; do
    only 'k % 3 == 1'
    changed "$change"
    quiet
done
# Two kernels by turns: each has the other's numbers.
only 'k % 2'
changed '0020,000e,UI=7.7.1'
mv c odd
only 'k % 2 == 0'
changed '0020,000e,UI=7.7.2'
mv odd c
quiet
ok batch c -O two --size 32x32
! grep -q '"missing_slices"' two/batch.jsonl || fail "a batch does not know the other series' numbers"
rm -r c/IM0020.dcm c/IM0030.dcm # a few that neither has
run info c --json
! grep -q 'every' out || fail "a gap in one of two kernels makes all of the other's numbers missing"
rm -rf c/odd
missing '25 of 47 slices missing'
# Numbers of other objects of the study are in the hundreds.
only 'k % 2'
mkdir c/other
cp "$data/series/localizer/"* c/other
ok info c --json
has out 'every 2nd slice'

# Options by each way in: those of a batch, a server's request and a job are one table.
only 'k % 4 == 0'
run batch c -O none --size 32x32
[ "$code" = 8 ] || fail "a batch of a thinned series ended with $code"
grep -q '"status":"refused"' none/batch.jsonl || fail "not refused: $(cat none/batch.jsonl)"
ok batch c -O some --size 32x32 --allow-missing-slices
grep -q '"missing_slices"' some/batch.jsonl || fail "missing_slices is not in the journal of a batch"
