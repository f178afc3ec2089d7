# Secondary captures from the command line: the study is joined, bytes repeat, a judge is content.
ok render "$data/phantom" --size 64x48 -o a.dcm
SOURCE_DATE_EPOCH=1000000000 && export SOURCE_DATE_EPOCH
ok render "$data/phantom" --size 64x48 -o one.dcm
ok render "$data/phantom" --size 64x48 --threads 3 -o two.dcm
cmp one.dcm two.dcm || fail "a .dcm does not repeat"
ok render "$data/phantom" --size 64x48 --new-uids -o new.dcm
cmp -s one.dcm new.dcm && fail "--new-uids changes nothing"
ok render "$data/phantom" --size 64x48 --background none -o clear.dcm
cmp one.dcm clear.dcm || fail "what shows through is not black"
ok render "$data/phantom" --size 64x48 --deidentify -o nobody.dcm
grep -q PHANTOM one.dcm || fail "the patient is not copied"
grep -q PHANTOM nobody.dcm && fail "--deidentify leaves the patient in"
ok render "$data/phantom" --size 64x48 --rotation 4 -o turn.dcm
for compression in rle jpeg-lossless jpeg-2000; do
    ok render "$data/phantom" --size 64x48 --compress $compression -o $compression.dcm
    ok compare one.dcm $compression.dcm
done
refused 5 'force' render "$data/phantom" --size 64x48 -o one.dcm
ok render "$data/phantom" --size 64x48 --force -o one.dcm
cmp one.dcm two.dcm || fail "--force changes the object"
command -v dciodvfy >/dev/null || exit 77
for file in one turn rle jpeg-lossless jpeg-2000; do
    dciodvfy $file.dcm >judge 2>&1 || fail "dciodvfy refuses $file.dcm: $(cat judge)"
    grep -E 'Error|Warning' judge && fail "dciodvfy on $file.dcm"
done
exit 0
