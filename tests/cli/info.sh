# info: facts as text and as JSON, the description only on request.
python=$(command -v python3) || exit 77
ok info "$data/phantom"
has out '^series [0-9.]+$'
has out 'renderable +yes'
ok info "$data/phantom" --modality MR,ct
has out '^series [0-9.]+$'
refused 3 'none of the 1 series is of --modality MR' info "$data/phantom" --modality MR
ok info "$data/phantom" "$data/geometry" "$data/broken" --json
cp out info.json
ok info "$data/phantom" --json --show-patient
cp out shown.json
"$python" - <<'PY' || fail "the JSON"
import json
info = json.load(open("info.json"))
keys = {"series_uid", "modality", "slices", "dims", "spacing_mm", "tilt_deg", "hu_min", "hu_max", "transfer_syntax",
        "orientation", "renderable", "findings", "box_mm", "passed", "study",
        "traits", "quantity", "unit", "value_min", "value_max"}
for s in info["series"]:
    assert set(s) == keys, set(s) ^ keys
    assert isinstance(s["slices"], int) and isinstance(s["tilt_deg"], (int, float)) and isinstance(s["renderable"], bool)
    assert len(s["dims"]) == 3 and len(s["spacing_mm"]) == 3
    assert all(x is None or x > 0 for x in s["spacing_mm"]), s["spacing_mm"]
    assert s["spacing_mm"][2] is not None or not s["renderable"], s
    for f in s["findings"]:
        assert set(f) == {"code", "severity", "text"} and f["severity"] in ("note", "warning", "refusal"), f
    if s["renderable"]:
        assert s["hu_min"] < s["hu_max"], s
    elif s["passed"]:
        assert s["slices"] == 1 and any(f["code"] == "passed" for f in s["findings"]), s
    else:
        assert any(f["severity"] == "refusal" for f in s["findings"]), s
    assert not s["passed"] or not s["renderable"], s
    assert len(s["study"]) == 16, s
assert any(s["passed"] for s in info["series"]) and not any("2.25." in str(s["study"]) for s in info["series"])
phantom = [s for s in info["series"] if s["dims"] == [64, 64, 48]]
assert len(phantom) == 1
phantom = phantom[0]
assert [round(x, 6) for x in phantom["spacing_mm"]] == [3.5, 3.5, 4.5], phantom["spacing_mm"]
assert phantom["slices"] == 48 and phantom["modality"] == "CT" and phantom["orientation"] == "axial"
assert abs(phantom["tilt_deg"]) < 1e-6
assert [round(phantom["box_mm"][2 * a + 1] - phantom["box_mm"][2 * a], 6) for a in range(3)] == [220.5, 220.5, 211.5]
assert any(abs(s["tilt_deg"] - 20) < 0.01 for s in info["series"])
assert any(not s["renderable"] for s in info["series"])
shown = json.load(open("shown.json"))
shown = shown["series"][0]
assert set(shown) == keys | {"description", "study_date", "series_number"}
assert shown["study_date"] == "2000-01-01" and shown["series_number"] == 1, shown
PY
# Without two positions the spacing of slices is undefined, and omitted: a scout alone, one slice, all at one position.
mkdir scout
cp "$data"/series/localizer/IM0011.dcm scout
for folder in scout "$data/geometry/one-slice" "$data/geometry/same-position"; do
    ok info "$folder"
    has out '^  spacing +[0-9.]+ x [0-9.]+ mm$'
    has out 'renderable +no'
    ok info "$folder" --json
    "$python" -c 'import json
found = json.load(open("out"))["series"]
assert len(found) == 1 and found[0]["spacing_mm"][2] is None, found' || fail "the slice spacing of $folder"
done
refused 3 'nowhere' info nowhere
refused 3 '' info "$data/broken/none"
# Packed files are counted by their packer.
mkdir packed
gzip -c "$data/phantom/IM0001.dcm" >packed/IM0001.dcm
refused 3 'packed: no CT, MR or PET slice among 1 file: 1 packed with gzip \(unpack first\)' info packed
# Header text drives no terminal; twelve unsigned bits that are called signed, and Double Float Pixel Data, are refused.
"$python" - "$data" <<'PY' || fail "the damaged headers"
import os, shutil, sys

def change(source, name, what, by, last=False):
    os.mkdir(name)
    for f in os.listdir(os.path.join(sys.argv[1], source)):
        data = open(os.path.join(sys.argv[1], source, f), "rb").read()
        at = data.rfind(what) if last else data.find(what)
        assert at >= 0, (source, what)
        open(os.path.join(name, f), "wb").write(data[:at] + by + data[at + len(what):])

change("pixels/unsigned-12", "signed", b"\x28\0\x03\x01US\2\0\0\0", b"\x28\0\x03\x01US\2\0\1\0")
change("pixels/unsigned-12", "double", b"\xe0\x7f\x10\0OW", b"\xe0\x7f\x09\0OD", last=True)
change("pixels/unsigned-12", "escape", b"\x20\0\x0e\0UI", b"\x20\0\x0e\0UI", last=True)
for f in os.listdir("escape"):
    with open(os.path.join("escape", f), "r+b") as file:
        data = file.read()
        file.seek(data.find(b"\x20\0\x0e\0UI") + 10)
        file.write(b"\x1b\xff")
PY
ok info signed
has out 'renderable +no: .*its values from -[0-9]+ to [0-9]+ look like unsigned pixels'
refused 4 'look like unsigned pixels' render signed -o x.png
ok info double
has out 'no: .*Double Float Pixel Data \(7FE0,0009\)'
refused 3 'UID \(0020,000E\) holds control characters' info escape
