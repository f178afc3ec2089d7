# --slab, --slab-at and --window; what vessel says of a series without contrast agent.
small="--size 64x64"
ok render "$data/phantom" $small -p soft -o whole.png
ok render "$data/phantom" $small -p soft --slab 5 -o slab.png
! cmp -s whole.png slab.png || fail "--slab changes nothing"
ok render "$data/phantom" $small -p soft --slab 5 --slab-at 30 -o front.png
! cmp -s front.png slab.png || fail "--slab-at changes nothing"
ok render "$data/phantom" $small -p soft --slab 5 --slab-at 30 --engine raycast -o raycast.png
cmp front.png raycast.png || fail "the engines differ"
ok render "$data/phantom" $small -p soft --slab 1000 -o wide.png
cmp whole.png wide.png || fail "a slab around everything changes something"
ok render "$data/phantom" $small -p soft --slab 5 --explain
has out 'slab of 5 mm'
has out 'inside of the body'
ok render "$data/phantom" $small -p soft --remove-table off --explain
has out 'everything in the volume'
refused 2 'slab' render "$data/phantom" $small --slab-at 5 -o x.png
refused 2 'slab' render "$data/phantom" $small --slab 5 --engine classic -o x.png
refused 2 'slab' render "$data/phantom" $small --slab 0 -o x.png

ok render "$data/phantom" $small -p soft --window -160,240 -o same.png
cmp whole.png same.png || fail "the preset's own window changes something"
ok render "$data/phantom" $small -p soft --window 0,80 -o narrow.png
! cmp -s whole.png narrow.png || fail "--window changes nothing"
for window in 5 80,0 1,1 a,b 1,2,3; do
    refused 2 'window' render "$data/phantom" $small -p soft --window $window -o x.png
done

ok render "$data/phantom" $small -p vessel -o vessel.png
has err '^ctsplat: warning: preset vessel: no contrast agent'
ok render "$data/phantom" $small -p bone -o bone.png
! grep -q contrast err || fail "bone speaks of contrast agent"
