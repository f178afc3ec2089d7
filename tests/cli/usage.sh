# Wrong usage: exit code 2, one line, and what to do.
refused 2 'a command is missing'
refused 2 'frobnicate: not one of: info render batch serve presets bench check compare' frobnicate
refused 2 'receive: gone since 0.5.0: Orthanc or storescp receives, and batch with .* renders' receive --folder in
refused 2 'receive: gone' receive --listen 127.0.0.1:0
ok help render
[ "$(wc -l <out)" -le 40 ] || fail "render --help does not fit a screen of 40 lines"
ok render --help all
[ "$(grep -cE '^  (-., |    )--' out)" -gt 60 ] || fail "render --help all is not all"
ok help render
cp out help
ok render --help
cmp out help || fail "help render is not render --help"
refused 2 'frobnicate' help frobnicate
refused 2 'did you mean --version' --verison
refused 2 '--json: no such option before the command' --json
refused 2 'render: PATH is missing' render
refused 2 'render: no output' render "$data/phantom"
refused 2 '--frob: no such option .*render --help' render --frob x
refused 2 '-x: no such option' render -x
refused 2 '--size: its argument is missing \(WxH\)' render x --size
refused 2 '--json: not an option of render' render x --json
refused 2 'takes no argument' info x --json=yes
refused 2 'IPv4 alone' info --from 'A@[::1]:104'
refused 2 'compare: a picture is missing' compare a.png
refused 2 'one argument too many: c.png' compare a.png b.png c.png
refused 2 'one argument too many' presets bone skin
refused 2 'one argument too many' check x

# value OPTION BAD...: each is refused with a message that names the option
value()
{
    option=$1
    shift
    for bad in "$@"; do
        refused 2 "^ctsplat: error: --?$option" render "$data/phantom" -o x.png "--$option" "$bad"
        [ ! -e x.png ] || fail "a refused run wrote something"
    done
}
value size 0x5 5 5x x5 32769x5 1e3x5 axb -5x5 '5x5 ' 99999999999999999999x1
value view up 1 1,2,3 0,91 nan,0 0x10,0 1,,2 ''
value rotation 0 -1 1.5 x 10000
value mm-per-pixel 0 -1 nan inf 1e9 x
value engine '' tile TILED
value kernel boxy tent: tent:0 tent:9 tent:x
value samples 0 65 x
value max-error 0 -1 x
value void yes
value grey-bits 7 17 8.5
value opacity-unit cm
value tolerance -1 x
value mode MIP x-ray
value shade yes 1
value background red '#12345' '#1234567' '#gggggg'
value crop 1,2,3 1,2,3,4,5,6,7 2,1,0,1,0,1 a,b,c,d,e,f
value remove-table maybe
value annotate scales orientation,, ,
value verify -1 x
value compress jpeg
value threads 0 1025 x
value series ''

# Misspelt options cause a suggestion; options of batch with several values are suggested by render.
refused 2 'vew: no such option .did you mean --view' render x --vew left
refused 2 'did you mean render' rendr x
refused 2 'boen: no such preset .did you mean bone' render "$data/phantom" -p boen -o x.png
refused 2 'did you mean png' render "$data/phantom" -o x.pgn
refused 2 'did you mean tiled' render "$data/phantom" -o x.png --engine tield
refused 2 'not an option of render, but of batch' render "$data/phantom" -o x.png --jobs 2
refused 2 'bone,skin: no such preset' render "$data/phantom" -o x.png --preset bone,skin
refused 2 '--view left,head: not one of' render "$data/phantom" -o x.png --view left,head
# Other spellings are the same option, and those that are gone are none.
small="--size 16x16 --deidentify"
ok render "$data/phantom" -o new.png $small --preset bone --view left --ambient-occlusion 0.5
ok render "$data/phantom" -o old.png $small --presets bone --views left --occlusion 0.5
cmp old.png new.png || fail "--presets, --views and --occlusion make another picture"
refused 2 '--preset skin: .*bone ' render "$data/phantom" -o x.png --presets bone -p skin
for gone in appearance=x.json resume slab-at=3; do
    refused 2 'no such option' render "$data/phantom" -o x.png --$gone
done
refused 2 '--preset skin: .*bone .*ctsplat batch --preset' render "$data/phantom" -o x.png -p bone -p skin
refused 2 '--view left: .*ctsplat batch --view' render "$data/phantom" -o x.png --view right --view left
ok render "$data/phantom" -o number.png --size 16x16 --series-number 4
has err 'warning: --series-number acts on .*dcm outputs, and there is none'

# The whole word after an option is its argument, whatever it begins with.
ok render "$data/phantom" --view -30,20 --size 32x32 -o a.png
ok render "$data/phantom" --view=-30,20 --size=32x32 -ob.png
cmp a.png b.png || fail "--view -30,20 and --view=-30,20 differ"
ok render --size 32x32 -o c.png --view -30,20 -- "$data/phantom"
cmp a.png c.png || fail "the order of options matters"
refused 3 'no-such-file' info -- --no-such-file

ok --help
has out '^Usage: ctsplat COMMAND'
[ "$(wc -l <out)" -le 24 ] && ! grep -qE '.{102}' out || fail "--help does not fit 24 lines of a terminal: $(cat out)"
ok --version
has out '^ctsplat [0-9]+\.[0-9]+\.[0-9]+$'
for library in DCMTK OpenEXR libpng jansson; do
    has out "^$library [0-9]"
done
for command in info render batch serve presets bench check compare; do
    ok $command --help all
    has out "^Usage: ctsplat $command"
done

# Output that cannot be written is not done.
if [ -w /dev/full ]; then
    code=0
    "$ctsplat" presets >/dev/full 2>err || code=$?
    [ $code = 5 ] || fail "a full standard output gives exit code $code"
fi
