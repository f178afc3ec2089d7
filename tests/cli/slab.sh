# --slab and --window; the warning of preset vessel about a series without contrast agent.
small="--size 64x64"
ok render "$data/phantom" $small -p soft -o whole.png
ok render "$data/phantom" $small -p soft --slab 5 -o slab.png
! cmp -s whole.png slab.png || fail "--slab changes nothing"
ok render "$data/phantom" $small -p soft --slab 5@30 -o front.png
! cmp -s front.png slab.png || fail "another place changes nothing"
ok render "$data/phantom" $small -p soft --slab 5@30 --engine raycast -o raycast.png
cmp front.png raycast.png || fail "the engines differ"
ok render "$data/phantom" $small -p soft --slab 1000 -o wide.png
cmp whole.png wide.png || fail "a slab around everything changes something"
ok render "$data/phantom" $small -p soft --slab 5 --explain
has out 'slab of 5 mm'
has out 'inside of the body'
ok render "$data/phantom" $small -p soft --remove-table off --explain
has out 'everything in the volume'
refused 2 'slab' render "$data/phantom" $small --slab @5 -o x.png
refused 2 'slab' render "$data/phantom" $small --slab 5 --engine classic -o x.png
refused 2 'slab' render "$data/phantom" $small --slab 0 -o x.png

ok render "$data/phantom" $small -p soft --window -160,240 -o same.png
cmp whole.png same.png || fail "the preset's own window changes something"
ok render "$data/phantom" $small -p soft --window 0,80 -o narrow.png
! cmp -s whole.png narrow.png || fail "--window changes nothing"
ok render "$data/phantom" $small --window 0,80 -o idle.png
has err 'warning: preset bone: --window changes nothing in mode composite'
for way in '-p bone --mode mip' '-p bone --grey-bits 8' '-p soft'; do
    ok render "$data/phantom" $small $way --window 0,80 -o idle.png --force
    grep -q 'changes nothing' err && fail "--window acts with $way"
done
# The frame holds what the slab shows.
ok render "$data/phantom" $small -p skin --explain
has out '^frame: 2[0-9]+(\.[0-9]+)? x'
ok render "$data/phantom" $small -p skin --slab 5@90 --explain
has out '^frame: [1-9][0-9]?(\.[0-9]+)? x|^frame: 1[0-9][0-9](\.[0-9]+)? x'
ok render "$data/phantom" $small -p skin --slab 5@1000 -o none.png
has err 'warning: nothing .* lies in the slab'
ok render "$data/phantom" $small -p soft --explain
has out '--remove-table off: everything'
for window in 5 80,80 1,1 a,b 1,2,3; do
    refused 2 'window' render "$data/phantom" $small -p soft --window $window -o x.png
done

# A projection that is mostly white gives advice, and following it helps.
ok render "$data/phantom" $small -p brain --window -900,-800 -o white.png
has err '^ctsplat: warning: [0-9]+ % of the visible pixels are white, -800 HU or more \(move the --window up'
for way in '-p brain --window -900,2000' '-p skin --background #ffffff' '-p bone-window --window 0,3000'; do
    ok render "$data/phantom" $small $way -o fine.png --force
    grep -q 'is white' err && fail "a warning with $way"
done

ok render "$data/phantom" $small -p vessel -o vessel.png
has err '^ctsplat: warning: preset vessel: no contrast agent'
ok render "$data/phantom" $small -p bone -o bone.png
! grep -q contrast err || fail "bone speaks of contrast agent"
