# Messages about the input: the chosen series and the others, files left out, files that are not CT.
small="--size 16x16 --engine classic"

# IN OUT FROM TO: a copy in which one UID is replaced by another of the same length.
with_uid()
{
    LC_ALL=C sed "s/$(printf %s "$3" | sed 's/\./\\./g')/$4/g" "$1" >"$2"
    cmp -s "$1" "$2" && fail "$1 does not hold $3"
}

# The series with the most slices cannot be decoded: it is named with its reason, and so is the smaller one.
mkdir -p many/larger
cp "$data"/series/two/* many
n=0
for file in "$data"/phantom/IM000?.dcm "$data"/phantom/IM001?.dcm; do
    n=$((n + 1))
    with_uid "$file" many/larger/$n.dcm 1.2.840.10008.1.2.1 1.2.840.10008.1.2.9
done
ok render many $small -o taken.png --log log
larger=$("$ctsplat" info many/larger | sed -n 's/^series //p')
has err "^ctsplat: warning: 3 series found; taking 2\.25\.2004 \([^)]*\\), .*can be rendered; --series takes another, by UID or number"
has err "^ctsplat: warning: not taken: 1, $larger \([0-9]+ x [0-9]+ x 19, [^)]*\): transfer syntax 1\.2\.840\.10008\.1\.2\.9 "
has err '^ctsplat: warning: not taken: 3, 2\.25\.2005 \([^)]*\): fewer slices$'
[ "$(wc -l <err)" = 3 ] || fail "expected 3 lines, one for each series"
ok render many $small --series 2.25.2004 -o named.png
[ ! -s err ] || fail "note 'series found' printed although --series was given"
cmp taken.png named.png || fail "expected the series that the warning names, another one was rendered"
# In the log series go by their hashes.
has log '"code":"series_not_taken".*uid:[0-9a-f]{16} .*1\.2\.840\.10008\.1\.2\.9'
grep -qF -e "$larger" -e 2.25.2005 log && fail "the log names a series"
run render many/larger $small -o none.png --log failed
[ $code = 3 ] || fail "exit code $code"
has failed '"failed".*series uid:[0-9a-f]{16}: transfer syntax 1\.2\.840\.10008\.1\.2\.9 '

# Damaged files are named, each: one whose header ends too early, one without all of its pixels, two left out alike.
mkdir damaged
cp "$data"/phantom/* damaged
for file in IM0007 IM0021; do
    head -c 5000 "$data/phantom/$file.dcm" >damaged/$file.dcm
done
head -c 300 "$data/phantom/IM0030.dcm" >damaged/IM0030.dcm
ok render damaged $small -o damaged.png
for file in IM0007 IM0021 IM0030; do
    [ "$(grep -c "warning: .*$file.dcm: " err)" = 1 ] || fail "$file is not named once"
done

# Files that are no slices are counted by kind, images listed by info; a refusal lists them where there are no others.
mkdir other
with_uid "$data/phantom/IM0001.dcm" other/mr.dcm 1.2.840.10008.5.1.4.1.1.2 1.2.840.10008.5.1.4.1.1.7
cp other/mr.dcm other/mr-2.dcm
with_uid "$data/phantom/IM0001.dcm" other/odd.dcm 1.2.840.10008.5.1.4.1.1.2 1.2.826.0.1.99999.5.1.4.2
echo text >other/notes.txt
ok info "$data/phantom" other
has out '2 series, 1 passed over \(1 not DICOM\), 0 not readable$'
has out 'warning: 3 images of other classes are no slices of the volume \(.series. UID#2\)'
ok info other
has out 'renderable +no: holds 3 images of modality CT, and no volume'
ok info "$data/phantom" other --json
grep -A4 '"others"' out | tr -d ' \n' | grep -qF '{"notDICOM":1}' ||
    fail "the JSON counts other files otherwise: $(grep -A4 others out)"
refused 3 'other: no CT, MR or PET slice among 4 files: 2 Secondary Capture Image, 1 not DICOM, 1 of SOP class [0-9.]*' render other -o x.png
mkdir linked
ln -s "$data/phantom" linked/series
refused 3 'linked: no CT, MR or PET slice among 1 file: 1 links to folders' render linked -o x.png
refused 3 'mr.dcm: no CT, MR or PET slice among 1 file: 1 Secondary Capture Image' render other/mr.dcm -o x.png

# A reason is reported once.
for folder in "$data"/geometry/many-missing "$data"/geometry/one-slice many/larger; do
    ok info "$folder"
    has out '^  renderable +no: '
    why=$(sed -n 's/^  renderable  *no[a-z, ]*: //p' out)
    [ "$(grep -cF "$why" out)" = 1 ] || fail "the reason of $folder stands there twice"
done

# A feature that an engine lacks is reported with the engines that have it.
refused 2 'engine tiled has no kernel bspline \(classic, layers, void, combined and raycast have\)' \
    render "$data/phantom" --size 16x16 --kernel bspline -o x.png
