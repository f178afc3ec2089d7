# Presets: the list, one in full, a round trip through JSON, and presets of one's own.
python=$(command -v python3) || exit 77
ok presets
for name in bone skin muscle lung vessel metal ct-aaa ct-x-ray brain vessel-window; do
    has out "^$name "
done
ok presets ct-bone
has out '641\.385 +0\.715686'
ok presets brain
has out 'slab 10'
ok presets --json
"$python" - <<'PY' || fail "the JSON"
import json
presets = {p["name"]: p for p in json.load(open("out"))["presets"]}
assert sum(name.startswith("ct-") for name in presets) == 22
bone = presets["ct-bone"]
assert [(p["hu"], p["opacity"]) for p in bone["points"]] == [
    (-3024, 0), (-16.4458, 0), (641.385, 0.715686), (3071, 0.705882)], bone["points"]
assert bone["shade"] == {"ambient": 0.1, "diffuse": 0.9, "specular": 0.2, "power": 10}
assert presets["ct-soft-tissue"]["shade"] is None
assert presets["ct-mip"]["mode"] == "composite" and presets["brain"]["window"] == [0, 80]
PY

# The output of --json is a preset file that gives the same picture.
small="--size 40x30"
for name in bone ct-fat ct-bone; do
    ok presets $name --json
    cp out $name.json
    ok render "$data/phantom" $small -p $name -o built-in.png --force
    ok render "$data/phantom" $small -p ./$name.json -o file.png --force
    ok compare built-in.png file.png
done
ok presets --json
cp out all.json
refused 2 'line 2: there are [0-9]+ presets' presets all.json
ok presets 'all.json#ct-fat'
has out '^ct-fat: '

# One's own.
mkdir -p config/ctsplat/presets
printf '{"name": "own",\n "points": [{"hu": 0, "opacity": 0.5, "rgb": [1, 0, 0]}]}\n' >config/ctsplat/presets/mine.json
printf '{"name": "broken",\n "points": []}\n' >config/ctsplat/presets/broken.json
ok presets
has out '^mine .*yours'
has err 'warning: .*broken.json: line 2'
ok presets mine
ok render "$data/phantom" $small -p mine -o mine.png
# A built-in preset hides one of its name: it is not listed as if it could be used so, and its path is a way to it.
cp config/ctsplat/presets/mine.json config/ctsplat/presets/bone.json
cp config/ctsplat/presets/mine.json config/ctsplat/presets/mine.v2.json
ok presets
[ "$(grep -c '^bone ' out)" = 1 ] || fail "two presets of one name are listed"
has out '^mine\.v2 .*yours'
has err 'warning: your preset bone\.json: a built-in preset has its name'
ok presets mine.v2
ok render "$data/phantom" $small -p config/ctsplat/presets/bone.json -o hidden.png
cmp mine.png hidden.png || fail "the path of a hidden preset is no way to it"
rm config/ctsplat/presets/bone.json
refused 2 'broken.json: line 2: points has 0 entries' render "$data/phantom" $small -p broken -o x.png
refused 2 'there are: .* mine' presets nope
refused 2 './nope.json: No such file' presets ./nope.json
refused 2 'nope.vp: No such file' presets nope.vp

# The line that is wrong is the line that is named.
cat >bad.json <<'JSON'
{
  "name": "bad",
  "points": [
    {"hu": 100, "rgb": [1, 1, 1], "opacity": 0},
    {"hu": 200, "rgb": [1, 1, 1],
     "opacity": 1.5}
  ],
  "shade": null
}
JSON
refused 2 'bad.json: line 6: opacity is 1.5 \(0 to 1\)' presets bad.json
sed -i 's/1\.5/1/; s/"hu": 200/"hu": 20/' bad.json
refused 2 'bad.json: line 5: hu falls from 100 to 20' presets bad.json
sed -i 's/"hu": 20/"hu": 200/; s/"shade"/"shad"/' bad.json
refused 2 'bad.json: line 8: unknown key "shad"' presets bad.json
sed -i 's/"shad": null/"mode": "mop"/' bad.json
refused 2 'bad.json: line 8: mode "mop" is not one of: composite mip minip average' presets bad.json
