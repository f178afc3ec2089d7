# check: green, in the promised form, and its plot.
ok check --json
python=$(command -v python3) || exit 77
"$python" - out <<'PY' || fail "the JSON of check"
import json, sys
cases = json.load(open(sys.argv[1]))["cases"]
assert len({c["name"] for c in cases}) >= 60, len(cases)
assert {c["engine"] for c in cases} >= set("classic layers void combined tiled raycast".split())
for c in cases:
    assert set(c) == {"name", "engine", "expected", "found", "error", "bound", "pass"}, c
    assert c["pass"] is True and c["error"] <= c["bound"], c
PY
command -v gnuplot >/dev/null || exit 0
ok check --plot p.svg
has out '^[0-9]* cases, 0 failed'
has p.svg 'what shows behind 83 % of the light'
