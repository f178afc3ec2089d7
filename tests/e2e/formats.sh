# One render, three formats; the names are the given ones, and an existing file is refused unless --force is given.
ok render "$data/phantom" --size 96x64 -o a.png -o a.exr -o a.dcm
[ ! -s out ] || fail "a render prints to stdout"
[ "$(ls)" = "$(printf 'a.dcm\na.exr\na.png\nerr\nout')" ] || fail "expected a.dcm, a.exr, a.png, err, out; found: $(ls)"
py size.py a.png 96 64
if command -v exrheader >/dev/null; then
    exrheader a.exr >header
    has header 'displayWindow.*\(0 0\) - \(95 63\)'
    for channel in A B G R; do
        has header " $channel, 16-bit floating-point"
    done
    has header ' Z, 32-bit floating-point'
    # Frames of a rotation have depth too; a projection has no surface, and the log says so.
    ok render "$data/phantom" --size 40x30 --rotation 2 -o turn.exr
    exrheader turn-001.exr | grep -q ' Z, 32-bit' || fail "no depth in a frame"
    ok render "$data/phantom" --size 40x30 --mode mip -o mip.exr --log log
    has log '"skipped".*"depth".*mode mip'
    exrheader mip.exr | grep -q ' Z, ' && fail "depth in a projection"
    rm turn-00?.exr mip.exr log
fi
if command -v dciodvfy >/dev/null; then
    dciodvfy a.dcm >report 2>&1
    has report SCImage
    ! grep '^Error' report || fail "dciodvfy finds errors"
fi

cp a.png before.png
refused 5 'a\.png.*--force' render "$data/phantom" --size 96x64 --background none -o a.png
cmp a.png before.png || fail "a refused output changed"
ok render "$data/phantom" --size 96x64 --background none -o a.png --force
! cmp -s a.png before.png || fail "--force did not overwrite"

refused 5 'none/a\.png' render "$data/phantom" -o none/a.png
refused 2 '\.png.*\.exr.*\.dcm' render "$data/phantom" -o a.bmp
refused 2 '' render "$data/phantom"
