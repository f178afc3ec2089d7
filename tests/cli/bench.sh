# bench: every engine measured; lines, plot and page agree; what it refuses.
command -v gnuplot >/dev/null || exit 77
cat >peers <<'JSON'
{"peer":"shear-warp","setting":"opacity .02 to .98","wall_ms":21.5,"rmse":0.0243}

{"peer":"shear-warp","setting":"opacity .05 to .95","wall_ms":19.9,"psnr_db":31.3,"frames":9}
{"peer":"slow (exact)","wall_ms":1e5,"rmse":1e-7}
JSON
ok bench "$data/phantom" -O b --size 24x24 --peers peers
for engine in classic layers void combined tiled raycast; do
    has out "^$engine .* (front)?\$"
    has b/bench.jsonl "\"engine\":\"$engine\""
done
for engine in void combined; do
    has b/bench.jsonl "\"engine\":\"$engine\".*\"void\":\"key\""
done
has out 'Pictures of 24 x 24 pixels'
for key in engine kernel samples tolerance void wall_ms wall_ms_spread serial_ms peak_rss_bytes rmse rmse_trilinear psnr_db \
    max_error bound; do
    [ "$(grep -c "\"$key\":" b/bench.jsonl)" = "$(grep -c . b/bench.jsonl)" ] || fail "not every line has $key"
done
# The peers: in the page as they were given, in the plot by name, and no line of the bench's own.
has b/report.html 'shear-warp</td><td>opacity .02 to .98</td><td>21.5</td><td>0.0243</td><td>32.3<'
has b/report.html 'shear-warp</td><td>opacity .05 to .95</td><td>19.9</td><td>0.0272</td><td>31.3<'
has b/error-vs-time.svg '<text>shear-warp</text>'
has b/error-vs-time.svg '<text>slow .exact.</text>'
has b/error-vs-time.svg 'opacity .02 to .98'
! grep -q shear b/bench.jsonl || fail "a peer stands among the lines"

# A row, with two pictures of its own, for each line; nothing is fetched from anywhere.
[ "$(grep '<tr.*<td>' b/report.html | grep -vc 'class=peer')" = "$(grep -c . b/bench.jsonl)" ] || fail "rows of the page and lines differ"
[ "$(grep -o 'src="data:image/png;base64,[A-Za-z0-9+/=]*"' b/report.html | wc -l)" = \
    "$((2 * $(grep -c . b/bench.jsonl)))" ] || fail "thumbnails are missing"
sed 's/src="data:[^"]*"//g' b/report.html | grep -oE '(src|href|url)[=(].{9}' | grep -vE -e "^href='#" -e '^url[(]#' | grep -q . &&
    fail "the page needs more than itself"
has b/report.html '<svg'
for engine in classic layers void combined tiled raycast 'Pareto front'; do
    has b/error-vs-time.svg "<text>$engine</text>"
done
# The reference is what errors are measured against.
grep '"engine":"raycast"' b/bench.jsonl | grep -qE '"rmse":[0-9.]*e-' || fail "the reference differs from itself"

# What --max-error asks for, and a bound above what was measured.
python3 - b/bench.jsonl <<'PY' || fail "errors asked for and told"
import json, sys
rows = [json.loads(line) for line in open(sys.argv[1])]
asked = sorted(r["max_error"] for r in rows if r["max_error"])
assert asked == [0.1, 0.25, 0.5, 1, 2, 3, 5, 8, 12, 16], asked
for r in rows:
    assert (r["bound"] is not None) == (r["engine"] == "tiled"), r
    assert 0 <= r["serial_ms"] <= r["wall_ms"], r
    assert r["bound"] is None or r["rmse_trilinear"] <= r["bound"] + 2e-6, r
PY
has out '^tiled *tent *to 0.25/255 '
has b/error-vs-time.svg '<text>the error told, at most</text>'

refused 5 'bench.jsonl: .*--force' bench "$data/phantom" -O b --size 24x24
refused 2 'bench: -O DIR is needed' bench "$data/phantom"
refused 2 'output: not an option of bench' bench "$data/phantom" -o b
# What an engine cannot do is left out and said.
ok bench "$data/phantom" -O m --size 16x16 -p brain
has err 'left out: classic'
has m/report.html 'Left out'
has m/bench.jsonl '"engine":"tiled"'

# Lines of peers that cannot be drawn.
while IFS='|' read -r line why; do
    printf '{"peer":"a","wall_ms":1,"rmse":0.1}\n%s\n' "$line" >bad
    refused 2 "bad: line 2: .*$why" bench "$data/phantom" -O q --peers bad
done <<'LINES'
[1]|no JSON object
{"peer":"a",|no JSON object
{"wall_ms":1,"rmse":0.1}|peer
{"peer":"a'b","wall_ms":1,"rmse":0.1}|peer
{"peer":"a","setting":"a\nb","wall_ms":1,"rmse":0.1}|setting
{"peer":"a","wall_ms":0,"rmse":0.1}|wall_ms
{"peer":"a","wall_ms":1}|rmse
{"peer":"a","wall_ms":1,"rmse":2}|rmse
LINES
echo >bad
refused 2 'bad: holds no line' bench "$data/phantom" -O q --peers bad
refused 2 'nowhere: No such file' bench "$data/phantom" -O q --peers nowhere

# The paper's tables: every engine as the paper has it and as it is here, all with the bytes of plain splatting.
ok bench "$data/phantom" --paper --size 64x64 --threads 2
[ "$(grep -c 'same bytes$' out)" = 7 ] || fail "the paper's engines differ: $(cat out)"
grep -qE '^classic +[0-9.]+ +100.0 ' out && grep -qE '^combined .* 46.8 +38.3, 44, 58.1 ' out || fail "the paper's table: $(cat out)"
