# Secondary captures from the command line: they join the study, are reproducible, and pass a validator.
ok render "$data/phantom" --size 64x48 -o a.dcm
SOURCE_DATE_EPOCH=1000000000 && export SOURCE_DATE_EPOCH
ok render "$data/phantom" --size 64x48 -o one.dcm
ok render "$data/phantom" --size 64x48 --threads 3 -o two.dcm
cmp one.dcm two.dcm || fail "a .dcm does not repeat"
ok render "$data/phantom" --size 64x48 --new-uids -o new.dcm
cmp -s one.dcm new.dcm && fail "--new-uids changes nothing"
ok render "$data/phantom" --size 64x48 --background none -o clear.dcm
cmp one.dcm clear.dcm || fail "what shows through is not black"
ok render "$data/phantom" --size 64x48 --deidentify -o anonymous.dcm
grep -q PHANTOM one.dcm || fail "the patient is not copied"
grep -q PHANTOM anonymous.dcm && fail "--deidentify leaves the patient in"
ok render "$data/phantom" --size 64x48 --rotation 4 -o turn.dcm
for compression in rle jpeg-lossless; do
    ok render "$data/phantom" --size 64x48 --compress $compression -o $compression.dcm
    ok compare one.dcm $compression.dcm
done
refused 5 'force' render "$data/phantom" --size 64x48 -o one.dcm
ok render "$data/phantom" --size 64x48 --force -o one.dcm
cmp one.dcm two.dcm || fail "--force changes the object"
# Views of a preset are instances of one series, with a number that can be typed.
ok render "$data/phantom" --size 64x48 --view left -o left.dcm
for file in one left turn; do
    dcmdump +P 0020,000e +P 0020,0011 +P 0020,0013 $file.dcm 2>/dev/null | sed 's/.*\[\(.*\)\].*/\1/' |
        tail -3 >$file.names # the first UID is the source's
done
if [ -s one.names ]; then
    [ "$(sed -n 2,3p one.names | tr '\n' ' ')" = '1001 1 ' ] || fail "series and instance: $(cat one.names)"
    [ "$(sed -n 2,3p left.names | tr '\n' ' ')" = '1001 2 ' ] || fail "series and instance: $(cat left.names)"
    [ "$(sed -n 2p turn.names)" = 1401 ] || fail "the rotation's series: $(cat turn.names)"
    [ "$(head -1 one.names)" = "$(head -1 left.names)" ] || fail "a view has a series of its own"
fi
# Zeros that pad a study's values, and text after them, go neither into captures nor into states.
if command -v python3 >/dev/null; then
    mkdir padded
    python3 - "$data/geometry/two-slices" <<'PY' || fail "the padded slices"
import os, sys
for name in os.listdir(sys.argv[1]):
    with open(os.path.join(sys.argv[1], name), "rb") as f:
        data = f.read()
    for tag, vr, value in (b"\x10\0\x10\0", b"PN", b"Doe^Jo\0\0junk"), (b"\x10\0\x20\0", b"LO", b"ID7\0\0\0"):
        at = data.index(tag + vr)
        end = at + 8 + int.from_bytes(data[at + 6:at + 8], "little")
        data = data[:at + 6] + len(value).to_bytes(2, "little") + value + data[end:]
    with open("padded/" + name, "wb") as f:
        f.write(data)
PY
    ok render padded --size 64x48 -o padded.dcm --write-state padded-state.dcm
    python3 - padded.dcm padded-state.dcm <<'PY' || fail "zeros in what was written"
import sys
for name in sys.argv[1:]:
    with open(name, "rb") as f:
        data = f.read()
    assert b"PN\x06\0Doe^Jo\x10\0\x20\0LO\x04\0ID7 " in data, name
PY
fi
command -v dciodvfy >/dev/null || exit 77
for file in one turn rle jpeg-lossless; do
    dciodvfy $file.dcm >verdict 2>&1 || fail "dciodvfy refuses $file.dcm: $(cat verdict)"
    grep -E 'Error|Warning' verdict && fail "dciodvfy on $file.dcm"
done
exit 0
