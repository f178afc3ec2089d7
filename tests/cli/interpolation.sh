# --interpolation and --smooth: what they change, what they refuse, and that rendering and verification agree on it.
small="--size 64x64 --view 30,10"
ok render "$data/geometry/uneven" $small -p skin -o shape.png --verify 50 --log log
has log '"event":"error"'
has log '"code":"slices_moved"'
ok render "$data/geometry/uneven" $small -p skin --interpolation cubic -o cubic.png --verify 50 --log cubic.log
! grep -q slices_moved cubic.log || fail "cubics move something"
! cmp -s shape.png cubic.png || fail "shape changes nothing"
ok render "$data/geometry/uneven" $small -p skin --interpolation linear -o linear.png
! cmp -s cubic.png linear.png || fail "uneven slices are joined alike"
ok render "$data/phantom" $small -p skin -o cubic.png --force
ok render "$data/phantom" $small -p skin --interpolation linear -o linear.png --force
cmp cubic.png linear.png || fail "thin slices are changed"
ok render "$data/phantom" $small -p skin --explain
has out 'layers between slices: slices lie no further apart'
ok render "$data/phantom" $small -p skin --smooth 3 -o smooth.png --verify 50
! cmp -s cubic.png smooth.png || fail "--smooth changes nothing"
ok render "$data/phantom" $small -p skin --smooth auto -o auto.png
cmp cubic.png auto.png || fail "--smooth auto smooths a scan without noise"
ok render "$data/phantom" $small -p skin --smooth 0 -o none.png
cmp cubic.png none.png || fail "--smooth 0 changes something"
refused 2 'smooth' render "$data/phantom" $small --smooth 21 -o x.png
refused 2 'smooth' render "$data/phantom" $small --smooth -1 -o x.png
refused 2 'interpolation' render "$data/phantom" $small --interpolation nearest -o x.png
