# --montage: each tile is the picture of its size alone, in every format and for any number of threads; tiles that show
# the same share a scale; bad lists; label groups; a montage in a batch.
phantom=$data/phantom labels=$data/fuzz/labels/binary
text()
{
    py montage.py text "$1" "ctsplat:$2"
}

# A given scale; of a preset with one tile the scale is its own.
at='--mm-per-pixel 1.5 --centre 3,-2,1'
ok render "$phantom" $at --montage anterior,30,15,muscle@left,axial,sagittal@4 --annotate orientation,scale --size 199x130 -o m.png
ok render "$phantom" $at --size 66x65 --annotate orientation,scale -o 1.png
ok render "$phantom" $at --size 66x65 --annotate orientation,scale --view 30,15 -o 2.png
ok render "$phantom" $at --size 66x65 --annotate orientation,scale -p muscle --view left -o 3.png
ok render "$phantom" $at --size 66x65 --annotate orientation,scale --montage axial -o 4.png
ok render "$phantom" --mm-per-pixel 1.5 --centre 7,-2,1 --size 66x65 --annotate orientation,scale --montage sagittal -o 5.png
py montage.py m.png 3 1.png 2.png 3.png 4.png 5.png
for threads in 1 5; do
    ok render "$phantom" --montage muscle@left,skin,coronal,anterior,left --columns 5 --size 320x64 --threads $threads -o t$threads.png
done
cmp t1.png t5.png || fail 'threads change the montage'
ok render "$phantom" --size 64x64 -p muscle --view left -o 1.png --force
ok render "$phantom" --size 64x64 -p skin -o 2.png --force
ok render "$phantom" --size 64x64 --montage coronal -o 3.png --force
py montage.py t1.png 5 1.png 2.png 3.png - -

# The shared scale is that of the larger view; then tiles differ from pictures alone.
ok render "$phantom" --size 64x64 -o 1.png --force
ok render "$phantom" --size 64x64 --view left -o 2.png --force
ok render "$phantom" --montage anterior,left --size 128x64 --log log -o m.png --force
[ "$(text m.png mm_per_pixel)" = "$(printf '%s\n%s\n' "$(text 1.png mm_per_pixel)" "$(text 2.png mm_per_pixel)" | sort -g | tail -1)" ] ||
    fail "scale $(text m.png mm_per_pixel), expected the larger of $(text 1.png mm_per_pixel) and $(text 2.png mm_per_pixel)"
# Its error is that of its tiles, by area: sections have none.
rms()
{
    sed -n 's/.*"bound".*"rmse":\([^,]*\),.*/\1/p' "$1"
}
rm log
for tiles in anterior posterior anterior,posterior anterior,axial,coronal,posterior; do
    ok render "$phantom" --fit volume --montage $tiles --columns 4 --size "$(($(echo $tiles | tr , '\n' | wc -l) * 64))x64" --log log-$tiles -o m.png --force
done
printf '%s\n' "$(rms log-anterior)" "$(rms log-posterior)" "$(rms log-anterior,posterior)" "$(rms log-anterior,axial,coronal,posterior)" |
    awk '{e[NR] = $1} END {expected = sqrt((e[1] ^ 2 + e[2] ^ 2) / 2); for (i = 3; i < 5; i++) if (!(e[i] > 0) || (e[i] / expected - 1) ^ 2 > 1e-12) exit 1}' ||
    fail 'the bound is not that of the tiles'

# Captions; an .exr holds none. One derivation in a capture.
few="$phantom --montage anterior,skin@left,axial@-3 --size 300x100"
ok render $few -o plain.png -o plain.exr -o m.jpg -o m.webp
ok render $few --annotate captions -o named.png -o named.exr -o m.dcm
cmp plain.exr named.exr || fail 'an .exr has captions'
cmp -s plain.png named.png && fail 'no captions'
[ "$(text plain.png tiles)" = 'bone anterior, skin left, axial -3 mm' ] || fail "tiles: $(text plain.png tiles)"
ok render "$phantom" --montage sagittal@-38 --size 120x120 --annotate orientation -o letters.png
ok render "$phantom" --montage sagittal@-38 --size 120x120 --annotate orientation,captions -o both.png
cmp -s letters.png both.png && fail 'no caption below the letters'
py montage.py letter letters.png both.png
ok render "$phantom" --montage axial,coronal --size 64x32 -o s.dcm
ok render "$phantom" --annotate captions,labels --labels $labels --label-colours -p skin --view 30,15 -o one.png
if command -v dcmdump >/dev/null; then
    dcmdump m.dcm >dump
    [ "$(grep -c DerivationDescription dump)" = 1 ] || fail 'not one derivation'
    has dump 'DerivationDescription'
    dcmdump +L m.dcm | grep -q '\[Montage of bone anterior, skin left, axial -3 mm, orthographic, error estimate .*not for diagnostic use\]' ||
        fail "derivation: $(grep DerivationDescription dump)"
    has dump 'LO \[VR montage\].*SeriesDescription'
    grep -qE 'ViewCodeSequence|FrameIncrementPointer' dump && fail 'a view of a montage'
    dcmdump s.dcm >sections
    has sections 'DERIVED.SECONDARY.MPR'
    has sections '113072'
    has dump 'BurnedInAnnotation' && has dump 'CS \[YES\].*BurnedInAnnotation'
fi

# Labels alone.
ok render "$phantom" --labels $labels --label-colours --montage 1+2@30,15,2@left,anterior --size 192x64 --columns 3 -o m.png --force
ok render "$phantom" --labels $labels --label-colours --show 1,2 --view 30,15 --size 64x64 -o 1.png --force
ok render "$phantom" --labels $labels --label-colours --show 2 --view left --size 64x64 -o 2.png --force
ok render "$phantom" --labels $labels --label-colours --size 64x64 -o 3.png --force
py montage.py m.png 3 1.png 2.png 3.png
refused 2 'montage: --show nothing: no label has this name' render "$phantom" --labels $labels --montage nothing@left -o x.png

# The largest tiles: rows and columns by the size.
for size in '200x100 100x100' '100x200 100x100' '120x20 60x20'; do
    set -- $size
    ok render "$phantom" --montage axial,coronal --size $1 -o m.png --force
    for plane in axial coronal; do
        ok render "$phantom" --montage $plane --size $2 --mm-per-pixel "$(text m.png mm_per_pixel)" -o $plane.png --force
    done
done
ok render "$phantom" --size 3x1 --montage anterior,axial,left -o m.png --force
ok render "$phantom" --size 99x64 --montage anterior,axial --background none -o m.png --force
ok render "$phantom" --montage anterior,axial --explain
has out 'engine'

refused 2 'montage: a tile without a name' render "$phantom" --montage , -o x.png
refused 2 'montage.*empty argument' render "$phantom" --montage '' -o x.png
refused 2 'montage: a tile without a name' render "$phantom" --montage left,,right -o x.png
refused 2 'more than 256 tiles' render "$phantom" --montage "$(yes axial | head -10000 | paste -sd,)" --size 4000x4000 -o x.png
refused 2 '3 tiles do not fit 2 x 1 pixels' render "$phantom" --montage left,right,head --size 2x1 -o x.png
refused 2 '--montage nowhere: not a view or section' render "$phantom" --montage left,nowhere -o x.png
refused 2 '--montage skin: --view nowhere: not one of' render "$phantom" --montage skin@nowhere -o x.png
refused 2 '--montage axial: up: not a distance' render "$phantom" --montage axial@up -o x.png
refused 2 '--montage liver.spleen: not a view or section .labels need --labels.' render "$phantom" --montage liver+spleen@left -o x.png
refused 2 '--columns: there is no --montage' render "$phantom" --columns 3 -o x.png
for other in '--rotation 4' '--swivel 10,5' '--write-state x.dcm'; do
    refused 2 "--montage: ${other%% *} is given too" render "$phantom" --montage left,right $other -o x.png
done
refused 2 'mr-mip' render "$phantom" --montage left,mr-mip@left -o x.png

# In a batch one more picture of each series, which a changed list alone makes again.
ok batch "$phantom" -O batch --size 64x64 --view left -p bone,skin --formats png --montage left,muscle@left,axial
ok render "$phantom" --size 64x64 -p bone --montage left,muscle@left,axial -o m.png --force
cmp batch/*/montage.png m.png || fail 'the montage of a batch is another'
[ "$(ls batch/*/*.png | wc -l)" = 3 ] || fail "pictures: $(ls batch/*/*.png)"
has batch/index.html '"view":"montage"'
touch -d 2001-01-01 batch/*/*.png
ok batch "$phantom" -O batch --size 64x64 --view left -p bone,skin --formats png --montage left,muscle@left,axial
has err '1 of them in earlier runs'
ok batch "$phantom" -O batch --size 64x64 --view left -p bone,skin --formats png --montage left,muscle@right,axial
[ "$(find batch -name '*.png' -newermt 2002-01-01)" = "$(ls batch/*/montage.png)" ] || fail "rendered again: $(find batch -name '*.png' -newermt 2002-01-01)"
exit 0
