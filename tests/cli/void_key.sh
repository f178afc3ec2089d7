# --void key: the mixture, the key, and what it loses, never hidden.
python=$(command -v python3) || exit 77

# The loss is reported and measured; the engines with the key agree to the byte, with any number of threads.
small="--size 60x60 -p skin"
ok render "$data/phantom" $small --engine void -o strict.png --log strict.log
ok render "$data/phantom" $small --engine void --void key -o key.png --log key.log --threads 1
has err 'warning: --void key: below -[0-9]+ HU counts as void: [0-9.]+ % of the voxels .* [0-9.e-]+ % of the opacity'
has err 'verified 256 pixels, in 1/255: rmse'
has key.log '"skipped".*"void tissue".*% of the opacity'
has key.log '"event":"error".*"pixels":256'
grep -q '"event":"error"' strict.log && fail "strict was verified unasked"
ok render "$data/phantom" $small --engine combined --void key -o combined.png --threads 7 --verify 20
has err 'verified 2[0-9] pixels'
cmp key.png combined.png || fail "void and combined differ"
cmp -s strict.png key.png && fail "the key changes nothing"
run compare strict.png key.png
[ $code = 1 ] || fail "the key's picture does not compare"
has out '^rmse +0\.0'
"$python" - <<'PY' || fail "the key splats no fewer voxels"
import json
def splatted(name):
    return [e["splatted"] for e in map(json.loads, open(name)) if e["event"] == "voxels"][0]
assert splatted("key.log") <= splatted("strict.log")
PY
ok render "$data/phantom" $small --engine void --void key --explain
has out '^mixture model: air -1000 HU \(void\)'
has out '^void key: below -[0-9]+ HU counts as void'

# A key without effect loses nothing, with a warning.
for engine in classic tiled raycast; do
    ok render "$data/phantom" $small --engine $engine -o $engine.png
    ok render "$data/phantom" $small --engine $engine --void key -o $engine-key.png --log $engine.log
    has err "warning: --void key: engine $engine skips .*nothing is lost"
    has $engine.log '"skipped".*"void key"'
    cmp $engine.png $engine-key.png || fail "$engine takes the key"
done
ok render "$data/phantom" --size 60x60 -p lung --engine void --void key -o lung.png
has err 'warning: --void key: preset lung shows every tissue of the mixture, or none'
ok render "$data/phantom" --size 60x60 -p bone --engine void --void key -o bone.png --log bone.log
grep -q warning err && fail "a warning where nothing is lost"
has bone.log '"void tissue".* 0 % of the opacity'
