# The timing log: JSON Lines of the promised form, appended, whose stages add up, and no patient in it.
python=$(command -v python3) || exit 77
ok render "$data/phantom" --size 200x200 -o a.png --log log --threads 2 --engine tiled
ok render "$data/phantom" --size 200x200 -o b.png --log log --threads 1 --engine classic --verify 20
ok render "$data/phantom" --size 20x20 -o c.png --log -
grep '"event"' err >log2
"$python" - "$root" log log2 <<'PY' || fail "the log"
import json, pathlib, re, sys
runs, run = [], []
for name in sys.argv[2:]:
    for line in open(name):
        event = json.loads(line)
        assert isinstance(event["t_ms"], float) and event["t_ms"] >= 0, event
        run.append(event)
        if event["event"] == "done":
            runs.append(run)
            run = []
assert len(runs) == 3 and not run
fields = {
    "run": {"run_id", "version", "time", "command", "series_uid_hash"},
    "picture": {"preset", "view", "size", "frames"}, "stage": {"stage", "wall_ms", "cpu_ms", "items", "bytes"}, "skipped": {"what", "why"},
    "plan": {"text"}, "bound": {"rmse", "rms_estimate", "max", "kind", "cast", "engine", "level"}, "finding": {"code", "severity", "text"},
    "label": {"file", "number", "name", "source", "voxels", "ml", "hu_mean", "hu_sd", "touches_edge", "parts", "overlap", "empty",
              "label_in_air"},
    "table": {"body_ml", "removed_ml", "lost_percent"}, "voxels": {"total", "void", "reused", "splatted"},
    "error": {"pixels", "rmse", "rmse_low", "rmse_high", "psnr_db", "p999", "max", "share", "share_high", "cpu_ms", "picture_cpu_ms",
              "cost"},
    "output": {"path", "format", "bytes"}, "done": {"wall_ms", "cpu_ms", "serial_ms", "peak_rss_bytes", "threads",
    "threads_why"}, "failed": {"exit_code", "message"}}
# The manual lists all of them, and the source has no others.
root = pathlib.Path(sys.argv[1])
source = (root / "src/output/report/log.c").read_text()
written = re.findall(r'add_(?:event|once)\(\s*log, "(\w+)"|"event", "(\w+)"', source)
assert {a or b for a, b in written} == set(fields), written
section = (root / "man/ctsplat.1").read_text().split(".SH TIMING LOG")[1].split("\n.SH ")[0]
entries = dict(re.findall(r"\.TP\n\.B (\w+)\n(.*?)(?=\n\.TP|\Z)", section, re.S))
assert set(entries) == set(fields), set(entries) ^ set(fields)
for event, names in fields.items():
    documented = set(re.findall(r"\w+", entries[event]))
    assert names <= documented, (event, names - documented)
stages = "scan labels decode grey classify occlusion footprint splat composite shade warp export".split()
for run in runs:
    for event in run:
        assert set(event) == fields[event["event"]] | {"event", "t_ms"}, event
    assert [e["event"] for e in run].count("run") == 1 and run[0]["event"] == "run", run[0]
    assert [e["event"] for e in run].count("picture") == 1 and run[1]["event"] == "picture", run[:2]
    assert run[1]["preset"] == "bone" and run[1]["view"] == [0, 0] and run[1]["frames"] == 1, run[1]
    assert run[1]["size"] == ([20, 20] if run is runs[2] else [200, 200]), run[1]
    assert len(run[0]["run_id"]) == 16 and len(run[0]["series_uid_hash"]) == 16, run[0]
    assert run[0]["command"].startswith("render --size ") and ".png" in run[0]["command"], run[0]
    names = [e["stage"] for e in run if e["event"] == "stage"]
    assert len(set(names)) == len(names) and set(names) <= set(stages), names
    for needed in ("scan", "decode", "grey", "classify", "splat" if run is runs[1] else "shade", "composite", "export"):
        assert needed in names, needed
    whole = run[-1]["wall_ms"]
    assert 0 < run[-1]["serial_ms"] < whole, run[-1]
    total = sum(e["wall_ms"] for e in run if e["event"] == "stage")
    assert abs(total - whole) <= 0.05 * whole, (total, whole)
    assert run[-1]["peak_rss_bytes"] > 1e6
    plan = [e["text"] for e in run if e["event"] == "plan"]
    assert len(set(plan)) == len(plan) and any("layers" in text or "cells" in text for text in plan), plan
    outputs = [e for e in run if e["event"] == "output"]
    assert len(outputs) == 1 and outputs[0]["format"] == "png" and outputs[0]["bytes"] > 100
    voxels = [e for e in run if e["event"] == "voxels"]
    assert len(voxels) == 1 and voxels[0]["total"] == 64 * 64 * 48, voxels
assert len({run[0]["run_id"] for run in runs}) == 3 and len({run[0]["series_uid_hash"] for run in runs}) == 1
assert "shade" in [e.get("stage") for e in runs[1]]
assert runs[0][-1]["threads"] == 2 and runs[1][-1]["threads"] == 1
errors = [[e for e in run if e["event"] == "error"] for run in runs]
assert [len(e) for e in errors] == [0, 1, 0]
error = errors[1][0]
assert error["pixels"] >= 20 and 0 < error["rmse_low"] < error["rmse"] < error["rmse_high"] and error["rmse"] < 0.1
assert error["p999"] == error["max"] and 0 <= error["share"] <= 1
assert error["cost"] == ("less" if error["cpu_ms"] < error["picture_cpu_ms"] else "more") + " than the picture"
PY
ok render "$data/pixels/fractional-slope" --size 20x20 -o d.png --log found
has found '"event":"finding".*"code":"fractional_rescale","severity":"note","text":"the rescale slope'
ok render "$data/pixels/fractional-slope" --explain
has out '^note: the rescale slope'
# For any end of a run, its first line is run and its last one failed: a refused input, preset or output, an output that
# cannot be written, a signal during the reading of the preset, and one during rendering.
refused 3 'no-such' render no-such -o e.png --log failed-3
refused 2 'no such preset' render "$data/phantom" -p nope -o e.png --log failed-2
refused 5 'exists' render "$data/phantom" -o a.png --log failed-5
(ulimit -f 8 && "$ctsplat" render "$data/phantom" --size 500x500 -o full.png --log small 2>err) && fail "8 blocks were enough"
[ ! -e full.png ] || fail "a part of a picture"
mv small failed-5-full
mkfifo pipe
# stopped LOG SECONDS ARGS...: sends TERM so long after the log was created
stopped()
{
    name=$1 wait=$2
    shift 2
    "$ctsplat" render "$@" --log $name 2>err &
    until [ -e $name ]; do
        sleep 0.02
    done
    sleep $wait
    kill -TERM $!
    code=0
    wait $! || code=$?
    [ $code = 130 ] || fail "$name: exit code $code, expected 130"
}
stopped failed-130 0.3 "$data/phantom" -p ./pipe -o f.png
stopped failed-130-picture 1 "$data/phantom" --size 20000x20000 --engine raycast -o f.png
for name in failed-*; do
    [ "$(sed -n 1p $name | grep -c '"event":"run"')$(grep -c '"event":"run"' $name)" = 11 ] || fail "$name: $(cat $name)"
    code=${name#failed-}
    tail -1 $name | grep -q "\"event\":\"failed\".*\"exit_code\":${code%%-*}," || fail "$name: $(cat $name)"
    [ "$(grep -c -e '"event":"failed"' -e '"event":"done"' $name)" = 1 ] || fail "$name ends twice"
done
has failed-3 '"event":"failed".*"exit_code":3'
if [ -w /dev/full ]; then
    refused 5 '/dev/full: No space left' render "$data/phantom" --size 20x20 -o g.png --log /dev/full
fi
grep -iE 'phantom|patient' log log2 && fail "the log names the patient or the input"
exit 0
