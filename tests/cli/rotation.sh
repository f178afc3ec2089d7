# --rotation N: frames from --view on, in even steps of azimuth.
small="--size 40x30 -p ct-bone --fit volume"
ok render "$data/phantom" $small --rotation 4 --view 10,20 -o head.png
[ "$(ls head*)" = "$(printf 'head-000.png\nhead-001.png\nhead-002.png\nhead-003.png')" ] || fail "wrong names: $(ls head*)"
i=0
for azimuth in 10 100 190 280; do
    ok render "$data/phantom" $small --view $azimuth,20 -o single-$i.png
    cmp single-$i.png head-00$i.png || fail "frame $i is not the view $azimuth,20"
    i=$((i + 1))
done
ok render "$data/phantom" $small --rotation 1 -o one.png
[ -e one-000.png ] || fail "a rotation of one view has another name"
mkdir folder.x
ok render "$data/phantom" $small --rotation 2 -o folder.x/r.exr
[ -e folder.x/r-001.exr ] || fail "the folder's name was changed"
rm head-000.png head-001.png
refused 5 "head-002.png" render "$data/phantom" $small --rotation 3 -o new.png -o head.png
[ ! -e new-000.png ] || fail "work was done before the refusal"

# One multi-frame object; its first frame is the view itself.
ok render "$data/phantom" $small --rotation 4 --view 10,20 -o turn.dcm
ok render "$data/phantom" $small --view 10,20 -o first.dcm
ok compare turn.dcm first.dcm
if command -v dcmdump >/dev/null; then
    dcmdump +P NumberOfFrames turn.dcm | grep -q '\[4\]' || fail "not 4 frames"
fi
refused 2 'big.dcm: 9999 pictures of 8000x8000 are more than' render "$data/phantom" --size 8000x8000 --rotation 9999 -o big.dcm
refused 2 'big.dcm: 6 pictures' render "$data/phantom" --size 16384x16384 --rotation 6 -o big.dcm
refused 2 'big.dcm: 8 pictures' render "$data/phantom" --size 16384x16384 --rotation 8 --mode mip -o big.dcm

# With several threads files are written one frame behind: the same files, reported in order, and the stages add up.
for threads in 1 3; do
    mkdir by-$threads
    ok render "$data/phantom" --size 300x200 --rotation 5 --verify 20 --threads $threads --log by-$threads/log \
        -o by-$threads/r.png -o by-$threads/r.dcm
done
for name in $(cd by-1 && ls r*.png); do
    cmp by-1/$name by-3/$name || fail "$name depends on the number of threads"
done
if command -v dcmdump >/dev/null; then
    [ "$(dcmdump by-1/r.dcm | grep -v 'Time\|Date')" = "$(dcmdump by-3/r.dcm | grep -v 'Time\|Date')" ] ||
        fail "r.dcm depends on the number of threads"
fi
for threads in 1 3; do
    [ "$(grep -o '/r[-0-9]*\.[a-z]*' by-$threads/log)" = "$(printf '/r-00%d.png\n' 0 1 2 3 4; echo /r.dcm)" ] ||
        fail "outputs are not logged in order: $(cat by-$threads/log)"
    awk -F'[:,]' '/"stage"/ { sum += $8 } /"done"/ { ok = sum > 0.95 * $6 && sum < 1.05 * $6 } END { exit !ok }' \
        by-$threads/log || fail "stages do not add up: $(cat by-$threads/log)"
done

# A swivel's frames of the same view are rendered once, marks and files included.
ok render "$data/phantom" $small --swivel 8,2 --view 10,20 --annotate scale --log swivel.log -o swing.png -o swing.exr
i=0
for azimuth in 10 12 14 12 10 8 6 8; do
    ok render "$data/phantom" $small --view $azimuth,20 --annotate scale -o alone-$i.png -o alone-$i.exr
    for form in png exr; do
        cmp alone-$i.$form swing-00$i.$form || fail "frame $i of the swivel is not the view $azimuth,20 ($form)"
    done
    i=$((i + 1))
done
[ "$(grep -c '"what":"rendering again"' swivel.log)" = 3 ] || fail "not 3 of 8 frames were rendered before: $(grep again swivel.log)"
