# Unusual but usable series give a picture and one warning each.

# warn PATTERN PATH
warn()
{
    ok render "$2" --size 64x64 -o out.png --force
    has err "^ctsplat: warning: .*($1)"
    ! grep -q '^ctsplat: error: ' err || fail "an error and a picture: $2"
}

warn 'localizer' "$data/series/localizer"
# A tilt that the picture keeps is no warning.
ok render "$data/geometry/tilted" --size 64x64 -o tilted.png --log log
[ ! -s err ] || fail "a tilt that is kept is worth a line: $(cat err)"
has log '"gantry_tilt","severity":"note"'
warn '1 of 10 slices missing and interpolated' "$data/geometry/missing-slice"
warn 'IM0005.dcm: truncated' "$data/broken/truncated"
warn 'varies' "$data/geometry/uneven"
warn 'holds 2 volumes; this is volume 1' "$data/geometry/two-phases"
warn 'only 2 slices' "$data/geometry/two-slices"
ok render "$data/broken/strangers" --size 64x64 -o out.png --force
[ ! -s err ] || fail "strangers in a folder are worth a line: $(cat err)"
ok render "$data/series/two" --series 2.25.2005 --size 64x64 -o five.png
[ ! -s err ] || fail "a series that was asked for is worth a line: $(cat err)"
ok render "$data/series/two" --series 2.25.2004 --size 64x64 -o four.png
ok render "$data/series/two" --size 64x64 -o larger.png
has err '^ctsplat: .*2\.25\.2004'
cmp four.png larger.png || fail "not the series with the most slices"
! cmp -s four.png five.png || fail "--series makes no difference"
