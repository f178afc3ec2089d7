#!/usr/bin/env python3
"""README's figures: processor time and error of one picture by ctsplat, beside other renderers on the same machine.

    peers_plot.py CTSPLAT SERIES PRESET PEERS.jsonl OUT.svg

PEERS.jsonl is what `ctsplat bench --peers` takes, with processor times as wall_ms. Times are medians of five, of making
a picture of a volume in memory; errors those that --verify finds. Prints the table and draws the plot by gnuplot."""
import json
import math
import statistics
import subprocess
import sys
import tempfile

ctsplat, series, preset, peers, svg = sys.argv[1:]
SCENE = ["--preset", preset, "--interpolation", "linear", "--remove-table", "off", "--fit", "volume", "--mm-per-pixel",
         "0.25", "--size", "1024x1024", "--shade", "off"]
SETTINGS = [["--max-error", str(e)] for e in (0.1, 0.25)] + [[]] + [["--max-error", str(e)] for e in (1, 2, 8)]
SETTINGS += [["--engine", engine] for engine in ("classic", "void")]
STAGES = {"classify", "footprint", "splat", "composite", "shade", "warp"}


def events(options):
    with tempfile.TemporaryDirectory() as folder:
        run = subprocess.run([ctsplat, "render", series, *SCENE, *options, "-o", folder + "/a.png", "--log", "-"],
                             check=True, capture_output=True, text=True)
    return [json.loads(line) for line in run.stderr.splitlines() if line.startswith("{")]


def cpu_ms(options):
    return sum(e["cpu_ms"] for e in events(options) if e["event"] == "stage" and e["stage"] in STAGES)


rows = []
times = [[] for _ in SETTINGS]
for _ in range(5):
    for i, options in enumerate(SETTINGS):
        times[i].append(cpu_ms(options))
for options, ms in zip(SETTINGS, times):
    error = next(e["rmse"] for e in events([*options, "--verify", "4000"]) if e["event"] == "error")
    rows.append(("ctsplat", " ".join(options).replace("--", "") or "default", statistics.median(ms), error))
unit = next(ms for _, setting, ms, _ in rows if setting == "default")
with open(peers, encoding="ascii") as lines:
    for p in map(json.loads, lines):
        rows.append((p["peer"], p["setting"], p["wall_ms"], p.get("rmse", 10 ** (-p.get("psnr_db", 0) / 20))))
print("| renderer | setting | processor time | error, of 255 |\n| --- | --- | ---: | ---: |")
for name, setting, ms, error in sorted(rows, key=lambda r: r[2]):
    print("| %s | %s | %.2g | %.2g |" % (name, setting, ms / unit, 255 * error))
print("(ctsplat's default: %.0f ms)" % unit, file=sys.stderr)

script = ["set terminal svg noenhanced size 900,520 font 'sans,13' background 'white'", "set logscale xy", "set grid",
          "set xlabel 'processor time of one picture (default of ctsplat = 1)'",
          "set ylabel 'error, rms, of 255 levels'", "set key top right", "set xrange [0.08:40]", "set yrange [0.02:15]"]
names = list(dict.fromkeys(r[0] for r in rows))
for i, name in enumerate(names):
    script += ["$d%d << END" % i] + ['%g %g "%s"' % (ms / unit, 255 * e, s) for n, s, ms, e in rows if n == name] + ["END"]
script.append("plot " + ", ".join(
    "$d%d using 1:2 with points pt %d ps 1.2 lc rgb '%s' title '%s', $d%d using 1:2:3 with labels left rotate by 25 "
    "offset 0.9,0.4 font ',11' notitle" % (i, (7, 4, 8, 10)[i % 4], ("#b3123f", "#1a6f9c", "#8a6d00", "#333333")[i % 4], name, i)
    for i, name in enumerate(names)))
with open(svg, "wb") as out:
    out.write(subprocess.run(["gnuplot", "-"], input="\n".join(script).encode(), check=True, stdout=subprocess.PIPE).stdout)
