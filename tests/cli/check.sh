# check: green, in the promised form.
python=$(command -v python3) || exit 77
# checked LEAST: the last JSON has so many names of cases at least
checked()
{
    "$python" - out "$1" <<'PY' || fail "the JSON of check"
import json, sys
cases = json.load(open(sys.argv[1]))["cases"]
assert len({c["name"] for c in cases}) >= int(sys.argv[2]), len(cases)
assert int(sys.argv[2]) < 60 or {c["engine"] for c in cases} >= set("classic layers void combined tiled raycast".split())
for c in cases:
    assert set(c) - {"view", "size", "mm_per_pixel", "preset", "pixel"} == {
        "name", "engine", "expected", "found", "error", "bound", "pass"}, c
    assert "pixel" not in c or 0 <= c["pixel"][0] < c["size"][0] and 0 <= c["pixel"][1] < c["size"][1], c
    assert c["pass"] is True and c["error"] <= c["bound"], c
PY
}
if [ "$CTS_SANITIZE" = none ]; then
    ok check --json
    checked 60
else
    # Some of each group of cases: the others take the same paths with other numbers.
    for group in slab 'ramp: ' range thin order cut layers stiff same 'equal: with' 'voxels: dots' 'voxels: grazing' \
        'voxels: a peak' 'voxels: a step, oblique' 'labels: one' 'labels: fractions, two'; do
        ok check --json --only "$group"
        checked 1
    done
fi
# A case alone, by its name; and nothing is not all.
ok check --only 'slab: anterior'
has out "^pass  slab: anterior .*tiled .*pixel [0-9]*,[0-9]* of 24x24  view 0,0 .*preset 0:0.03  --only 'slab: anterior'"
[ "$(grep -c '^pass' out)" = 7 ] || fail "--only ran more than the case of this name"
ok check --only 'ramp: lit'
[ "$(grep -c '^pass' out)" = 7 ] || fail "--only ran more than the case of this name"
ok check --only 'marker: '
[ "$(grep -c '^pass' out)" = 42 ] || fail "--only did not run all that hold these words"
has out '^42 cases, 0 failed'
refused 2 'no case .*no such case' check --only 'no such case'
