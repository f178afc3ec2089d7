# Rendering: outputs, refusals before any work, the right series, the right picture.
small="--size 40x30"
ok render "$data/phantom" $small -o a.png -o b.exr
[ ! -s out ] || fail "render prints on standard output"
[ -s a.png ] && [ -s b.exr ] || fail "an output is missing"
ok render "$data/phantom" $small --threads 7 -o again.png
cmp a.png again.png || fail "threads change the picture"

# Checked before any work, all of them.
refused 5 'a.png.*(exist|force)' render "$data/phantom" $small -o new.png -o a.png
[ ! -e new.png ] || fail "work was done before the refusal"
ok render "$data/phantom" $small -o a.png --force
cmp a.png again.png || fail "--force changes the picture"
refused 5 'no-such-folder' render "$data/phantom" $small -o no-such-folder/a.png
refused 3 '^ctsplat: error: nowhere: No such file' render nowhere $small -o a.png
ok render "$data/phantom" $small -o same.jpeg -o same.jpg
cmp same.jpeg same.jpg || fail ".jpeg is not .jpg"
refused 2 'x.bmp' render "$data/phantom" $small -o x.bmp
refused 2 'given twice' render "$data/phantom" $small -o x.png -o ./x.png
refused 5 'folder' render "$data/phantom" $small -o x.png --log no-such-folder/log
[ ! -e x.png ] || fail "a refused run wrote something"

# A slice is never overwritten.
cp "$data"/syntax/explicit/* .
cp IM0004.dcm slice.png
slice=slice.png
before=$(cksum <"$slice")
refused 5 'CT slice' render . $small -o "$slice" --force
[ "$before" = "$(cksum <"$slice")" ] || fail "a slice was overwritten"

refused 3 'nowhere' render nowhere $small -o x.png
refused 3 '' render "$data/broken/none" $small -o x.png
refused 4 '' render "$data/geometry/one-slice" $small -o x.png
refused 2 'preset nope: no such preset; there are: bone skin .*ct-aaa' render "$data/phantom" $small -p nope -o x.png
refused 2 '2.25.1' render "$data/phantom" $small --series 2.25.1 -o x.png
refused 2 '' render "$data/phantom" $small --crop 5000,5001,0,1,0,1 -o x.png
[ ! -e x.png ] || fail "a refused run wrote something"

# Several series: the one with the most slices, with a note; or the requested one, without.
ok render "$data/series/two" $small -o two.png
has err '2 series found; taking 2\.25\.2004'
ok render "$data/series/two" $small --series 2.25.2005 -o other.png
grep -q 'series' err && fail "note 'series found' printed although --series was given"
ok render "$data/series/two" $small --series 2.25.2004 -o one.png
cmp two.png one.png || fail "not the series that was named"
cmp -s two.png other.png && fail "--series changes nothing"

# Each warning once.
ok render "$data/geometry/tilted" $small -o tilted.png
[ "$(grep -c warning err)" = "$(sort -u err | grep -c warning)" ] || fail "a warning is printed twice: $(cat err)"

# Background: a colour everywhere nothing is, or alpha.
ok render "$data/phantom" $small --background '#ff8000' -o orange.png
ok compare a.png a.png
cmp -s a.png orange.png && fail "--background changes nothing"
ok render "$data/phantom" $small --background none -o alpha.png

# Table removal: by the preset, or by the option.
ok render "$data/phantom" $small --remove-table off -o off.png --log log
has log '"skipped".*"table removal".*off by --remove-table off'
ok presets bone --json
sed 's/"remove_table": true/"remove_table": false/; s/"name": "bone"/"name": "kept"/' out >kept.json
ok render "$data/phantom" $small -p kept.json -o kept.png --log log
has log '"skipped".*"table removal".*off by the preset'
ok render "$data/phantom" $small -p kept.json --remove-table on -o on.png

# The plan, and no picture.
ok render "$data/phantom" $small --explain
has out '^preset bone, mode composite, engine auto, kernel tent$'
has out '^left out: .*: '
ok render "$data/phantom" $small --explain -o planned.png
[ ! -e planned.png ] || fail "--explain wrote a picture"

# A secondary capture repeats with SOURCE_DATE_EPOCH, and differs from the PNG by its 8 bits alone.
SOURCE_DATE_EPOCH=1700000000
export SOURCE_DATE_EPOCH
ok render "$data/phantom" $small -o a.dcm
ok render "$data/phantom" $small -o again.dcm
cmp a.dcm again.dcm || fail "a .dcm does not repeat"
run compare a.dcm a.png
[ $code = 1 ] || fail "a picture of 8 bits equals one of 16"
has out '^share +0 of'
for compression in rle jpeg-lossless; do
    ok render "$data/phantom" $small -o $compression.dcm --compress $compression
    ok compare a.dcm $compression.dcm
done
ok render "$data/phantom" $small -o warned.png --new-uids
has err 'warning: .*--new-uids.* there is none'

ls | grep -E '^\.|tmp' && fail "a temporary file is left"
exit 0

# A line for each picture, on request where stderr is no terminal.
grep -q "16x16  error" err && fail "a summary without --summary"
ok render "$data/phantom" --size 16x16 -o line.png -o line.jpg --summary
has err '^ctsplat: line.png, line.jpg  16x16  error [0-9.e-]+/255 \(default 0\.5[a-z, ]*\)  [0-9.]+ s$'
ok render "$data/phantom" --size 16x16 -o turn.png --rotation 2 --summary --max-error 8
[ "$(grep -cE '^ctsplat: turn-00[01].png  16x16  error [0-9.e-]+/255 \(asked 8\)' err)" = 2 ] || fail "not a line for each frame"
