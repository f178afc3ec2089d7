# bench: every engine measured; lines, plot and page agree; what it refuses.
command -v gnuplot >/dev/null || exit 77
ok bench "$data/phantom" -O b --size 24x24 --full
has err '^ctsplat: bench: [0-9]+ settings, about [0-9]+ seconds left$'
for engine in classic layers void combined sheets tiled raycast; do
    has out "^$engine .* (front)?\$"
    has b/bench.jsonl "\"engine\":\"$engine\""
done
for engine in void combined; do
    has b/bench.jsonl "\"engine\":\"$engine\".*\"void\":\"key\""
done
has out 'Pictures of 24 x 24 pixels'
for key in engine kernel samples tolerance void wall_ms wall_ms_spread serial_ms peak_rss_bytes rmse rmse_trilinear psnr_db \
    max_error bound rmse_interval rmse_trilinear_interval; do
    [ "$(grep -c "\"$key\":" b/bench.jsonl)" = "$(grep -c . b/bench.jsonl)" ] || fail "not every line has $key"
done
# A row for each line, as on standard output; nothing is fetched from anywhere.
[ "$(sed -n '/^<pre>/,/^<.pre>/p' b/report.html | wc -l)" = $(($(grep -c . b/bench.jsonl) + 2)) ] || fail "rows of the page and lines differ"
grep -oE '(src|href|url)[=(].{9}' b/report.html | grep -vE -e "^href='#" -e '^url[(]#' | grep -q . &&
    fail "the page needs more than itself"
has b/report.html 'Pictures of 24 x 24 pixels'
has b/report.html '<svg'
for engine in classic layers void combined tiled 'Pareto front'; do
    has b/error-vs-time.svg "<text>$engine</text>"
done
# The reference is what errors are measured against.
grep '"engine":"raycast"' b/bench.jsonl | grep -qE '"rmse":[0-9.]*e-' || fail "the reference differs from itself"

# The requested errors are in the table, and reported limits are above the measured errors.
python3 - b/bench.jsonl <<'PY' || fail "requested and reported errors in bench.jsonl"
import json, sys
rows = [json.loads(line) for line in open(sys.argv[1])]
for engine in ("sheets", "tiled"):
    asked = sorted(r["max_error"] for r in rows if r["max_error"] and r["engine"] == engine)
    assert asked == [0.1, 0.25, 0.5, 1, 2, 3, 5, 8, 12, 16], (engine, asked)
for r in rows:
    assert (r["bound"] is not None) == (r["engine"] in ("sheets", "tiled")), r
    assert 0 <= r["serial_ms"] <= r["wall_ms"], r
    for error in ("rmse", "rmse_trilinear"):
        low, high = r[error + "_interval"]
        assert low <= r[error] <= high, r
    assert r["bound"] is None or r["rmse_trilinear"] <= r["bound"] + 2e-6, r
PY
has out '^tiled *tent *to 0.25/255 '
has b/error-vs-time.svg '<text>reported error</text>'

refused 5 'bench.jsonl: .*--force' bench "$data/phantom" -O b --size 24x24
refused 2 'bench: -O DIR is needed' bench "$data/phantom"
refused 2 'output: not an option of bench' bench "$data/phantom" -o b
# Without gnuplot nothing is begun.
env PATH=/nowhere "$ctsplat" bench "$data/phantom" -O q --size 16x16 2>err && fail "a plot without gnuplot"
has err 'gnuplot cannot be run'
[ ! -e q/bench.jsonl ] || fail "measured for nothing"
# Features that an engine lacks are left out with a message.
ok bench "$data/phantom" -O m --size 16x16 -p brain
[ "$(grep -c . m/bench.jsonl)" -lt 30 ] && [ "$(grep -c . b/bench.jsonl)" -gt 50 ] || fail "--full measures no more"
has err 'left out: classic'
has m/report.html 'Left out'
has m/bench.jsonl '"engine":"tiled"'

# The paper's tables: every engine as the paper has it and as it is here, all with the bytes of plain splatting.
ok bench "$data/phantom" --paper --size 64x64 --threads 2
[ "$(grep -c 'same bytes$' out)" = 7 ] || fail "the paper's engines differ: $(cat out)"
grep -qE '^classic +[0-9.]+ +100.0 ' out && grep -qE '^combined .* 46.8 +38.3, 44, 58.1 ' out || fail "the paper's table: $(cat out)"
