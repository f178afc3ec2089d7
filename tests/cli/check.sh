# check: green, in the promised form.
ok check --json
python=$(command -v python3) || exit 77
"$python" - out <<'PY' || fail "the JSON of check"
import json, sys
cases = json.load(open(sys.argv[1]))["cases"]
assert len({c["name"] for c in cases}) >= 60, len(cases)
assert {c["engine"] for c in cases} >= set("classic layers void combined tiled raycast".split())
for c in cases:
    assert set(c) - {"view", "size", "mm_per_pixel", "preset", "pixel"} == {
        "name", "engine", "expected", "found", "error", "bound", "pass"}, c
    assert "pixel" not in c or 0 <= c["pixel"][0] < c["size"][0] and 0 <= c["pixel"][1] < c["size"][1], c
    assert c["pass"] is True and c["error"] <= c["bound"], c
PY
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
