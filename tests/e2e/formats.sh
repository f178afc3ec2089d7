# One render, several formats; the names are those asked for, and an existing file is refused unless --force is given.
expect 0 "$ctsplat" render "$data/phantom" --size 96x64 -o a.png -o a.exr
[ ! -s stdout ] || fail "a render prints to stdout"
[ "$(ls)" = "$(printf 'a.exr\na.png\nstderr\nstdout')" ] || fail "other files than asked for: $(ls)"
py size.py a.png 96 64
if command -v exrheader >/dev/null; then
    exrheader a.exr >header
    says header 'displayWindow.*\(0 0\) - \(95 63\)'
fi

cp a.png before.png
expect 5 "$ctsplat" render "$data/phantom" --size 96x64 --background none -o a.png
says stderr '^ctsplat: error: .*a\.png.*--force'
cmp a.png before.png || fail "a refused output changed"
expect 0 "$ctsplat" render "$data/phantom" --size 96x64 --background none -o a.png --force
! cmp -s a.png before.png || fail "--force did not overwrite"

expect 5 "$ctsplat" render "$data/phantom" -o none/a.png
says stderr '^ctsplat: error: none/a\.png'
expect 2 "$ctsplat" render "$data/phantom" -o a.jpg
says stderr '\.png.*\.exr.*\.dcm'
expect 2 "$ctsplat" render "$data/phantom"
