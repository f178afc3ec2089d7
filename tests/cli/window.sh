# A mode without a preset gets a window fitted to the data; pictures that are all black or white cause a warning.
/usr/bin/python3 -c 'import numpy' 2>/dev/null || exit 77
cat >shares.py <<'PY'
import sys, zlib, struct
import numpy
data, at, chunks = open(sys.argv[1], "rb").read(), 8, b""
while at < len(data):
    n, kind = struct.unpack(">I4s", data[at:at + 8])
    if kind == b"IHDR":
        width, height, depth, colour = struct.unpack(">IIBB", data[at + 8:at + 18])
    if kind == b"IDAT":
        chunks += data[at + 8:at + 8 + n]
    at += 12 + n
channels = {0: 1, 2: 3, 6: 4}[colour]
row = width * channels * 2
rows = numpy.frombuffer(zlib.decompress(chunks), numpy.uint8).reshape(height, row + 1)
assert depth == 16
step = channels * 2
out = numpy.zeros((height, row), int)
for y in range(height):
    line, before = rows[y, 1:].astype(int), out[y - 1] if y else numpy.zeros(row, int)
    kind = rows[y, 0]
    for x in range(row):
        a = out[y, x - step] if x >= step else 0
        b, c = before[x], before[x - step] if x >= step else 0
        p = a + b - c
        paeth = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
        out[y, x] = line[x] + (0, a, b, (a + b) // 2, paeth)[kind] & 255
grey = out[:, 0::step] / 255
print(int(100 * ((grey > 0.05) & (grey < 0.95)).mean()))
PY
small="--size 48x48"
for mode in mip minip average; do
    ok render "$data/phantom" $small --mode $mode -o $mode.png
    ! grep -q 'nearly all\|is white' err || fail "$mode: $(cat err)"
    [ "$(/usr/bin/python3 shares.py $mode.png)" -ge 15 ] || fail "mode $mode shows little: $(/usr/bin/python3 shares.py $mode.png) %"
    ok render "$data/phantom" $small --mode $mode -o x.png --explain
    has out "^window -?[0-9]+ to -?[0-9]+ HU, fitted to mode $mode"
    # A window given by options, or by a preset, is kept.
    ok render "$data/phantom" $small --mode $mode --window -100,900 -o given.png --force
    ok render "$data/phantom" $small --mode $mode --window -100,900 -p bone -o given-bone.png --force
    cmp given.png given-bone.png || fail "--window does not hold in mode $mode"
    ok render "$data/phantom" $small --mode $mode -p bone -o x.png --explain
    ! grep -q fitted out || fail "a preset's window is replaced"
done
# A rotation has one window, a state keeps it, a batch has it too.
ok render "$data/phantom" $small --mode minip --rotation 3 -o turn.png --write-state turn.dcm --log log
ok render "$data/phantom" $small --mode minip -o alone.png --write-state alone.dcm
ok render "$data/phantom" --state alone.dcm -o again.png
cmp alone.png again.png || fail "a state loses the window"
# An inverted window shows high values dark, in a state too.
ok render "$data/phantom" $small --mode mip --window 900,-100 -o dark.png --write-state dark.dcm
ok render "$data/phantom" --state dark.dcm -o dark-again.png
cmp dark.png dark-again.png || fail "a state loses an inverted window"
! cmp -s dark.png given.png || fail "an inverted window changes nothing"
refused 2 'two different values' render "$data/phantom" --window 7,7 -o x.png
# A relative preset is not for HU.
refused 2 'preset mr: is of scale relative, and the series, CT, of HU .presets that fit: bone' render "$data/phantom" -p mr -o x.png
ok batch "$data/phantom" $small --mode minip -O archive
cmp alone.png archive/*/bone-anterior.png || fail "a batch has another window"
# Modes minip and average look at the body alone, whatever the preset of another mode says about the table.
printf '{"name": "kept", "points": [{"hu": -200, "rgb": [1, 1, 1], "opacity": 0}, {"hu": 900, "rgb": [1, 1, 1], "opacity": 1}]}' >kept.json
for mode in minip average; do
    for table in on off; do
        ok render "$data/phantom" $small -p kept.json --mode $mode --remove-table $table -o table-$table.png --force
    done
    ok render "$data/phantom" $small -p kept.json --mode $mode -o body.png --force
    cmp body.png table-on.png || fail "mode $mode looks at the air around the body"
    ! cmp -s body.png table-off.png || fail "mode $mode: --remove-table off changes nothing"
    sed "s/\"kept\"/&, \"mode\": \"$mode\"/" kept.json >own.json
    for given in '' "--mode $mode"; do
        ok render "$data/phantom" $small -p own.json $given -o own.png --force
        cmp own.png table-off.png || fail "remove_table of a preset of mode $mode does not hold: $given"
    done
done
# A window of the other direction than the preset's takes the background of its lowest values along.
cat >dark.json <<'JSON'
{"name": "dark", "mode": "mip", "window": [900, -100], "background": "#ffffff", "remove_table": true,
 "points": [{"hu": -100, "rgb": [1, 1, 1], "opacity": 0}, {"hu": 900, "rgb": [0, 0, 0], "opacity": 1}]}
JSON
same()
{
    ok render "$data/phantom" $small $1 -o first.png --force
    ok render "$data/phantom" $small $2 -o second.png --force
    cmp first.png second.png || fail "$1 is not $2"
}
same '-p dark.json --window -100,900' '-p dark.json --window -100,900 --background #000000'
same '-p dark.json --window 800,-100' '-p dark.json --window 800,-100 --background #ffffff'
same '-p bone --mode mip --window 900,-100' '-p bone --mode mip --window 900,-100 --background #ffffff'
# The background is not among the visible pixels.
ok render "$data/phantom" $small --mode mip --mm-per-pixel 15 --background '#ffffff' -o behind.png
! grep -q 'is white\|are white' err || fail "the background counts: $(cat err)"
# Little but black, little but white.
ok render "$data/phantom" $small -p bone --mode minip --window 2800,12000 -o black.png
has err 'warning: the picture is nearly all black: .*--window'
ok render "$data/phantom" $small -p metal --crop 0,4,0,4,0,4 -o none.png
[ "$(grep -c warning err)" = 1 ] || fail "expected one warning for an empty picture: $(cat err)"
ok render "$data/phantom" $small -p bone --background '#ffffff' --mm-per-pixel 200 -o white.png
has err 'warning: the picture is nearly all white'
ok render "$data/phantom" $small -o plain.png
[ ! -s err ] || fail "expected no warning: $(cat err)"
