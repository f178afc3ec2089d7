#!/usr/bin/env python3
"""README's figures: processor time and error of one picture by ctsplat and by other renderers. `./dev figures` runs

figures.py CTSPLAT RAW2CT MATRIX.dat PEERS.jsonl OUT.svg

MATRIX.dat: the demo's head (int16, 108 slices of 256 x 256), which is resampled to 512 x 512 x 324 voxels,
trilinearly.
PEERS.jsonl: results of other renderers for the same scene, an object per line: peer, setting, cpu_ms of one
picture of a volume in memory, rmse or psnr_db over display values 0..1. The peer `ctsplat` with the setting
`engine classic` is the reference measured on the same machine: all peers' times are scaled by the ratio of its
present time to that time. When that engine's code gets faster, all peers must be measured again.
Times are medians of five; errors are those of --verify. Prints the table, in units of the default's time, and
draws the plot with gnuplot."""
import json
import statistics
import subprocess
import sys
import tempfile

import numpy

ctsplat, raw2ct, matrix, peers, svg = sys.argv[1:]
YARDSTICK = ["--engine", "classic"]
SETTINGS = [[], *(["--max-error", str(e)] for e in (0.1, 0.25, 1, 2, 8)), YARDSTICK, ["--engine", "void"]]
STAGES = {"classify", "occlusion", "footprint", "splat", "composite", "shade", "warp"}
SPACING = [0.95703125 * 255 / 511, 0.95703125 * 255 / 511, 1.5 * 107 / 323]
PRESET = {"name": "figures", "points": [{"hu": hu, "rgb": rgb, "opacity": opacity} for hu, rgb, opacity in (
    (-1024, [0.45, 0.2, 0.15], 0), (150, [0.75, 0.35, 0.25], 0), (500, [1, 0.9, 0.75], 0.75), (1200, [1, 1, 1], 0.9))]}
SCENE = ("--interpolation linear --remove-table off --fit volume --mm-per-pixel 0.25 --size 1024x1024 --shade off "
         "--force --log -").split()


def finer(volume, n, axis):
    """n values along an axis, ends on ends, straight lines between."""
    place = numpy.linspace(0, volume.shape[axis] - 1, n)
    below = numpy.minimum(place.astype(int), volume.shape[axis] - 2)
    share = (place - below).reshape([-1 if a == axis else 1 for a in range(3)]).astype(numpy.float32)
    return volume.take(below, axis) * (1 - share) + volume.take(below + 1, axis) * share


def make_series(folder):
    head = numpy.fromfile(matrix, "<i2").reshape(108, 256, 256).astype(numpy.float32)
    for axis, n in enumerate((324, 512, 512)):
        head = finer(head, n, axis)
    numpy.rint(head).astype("<i2").tofile(folder + "/head.raw")
    subprocess.run([raw2ct, "--size", "512,512,324", "--spacing", ",".join("%.10g" % s for s in SPACING), "--flip", "y",
                    folder + "/head.raw", folder + "/head"], check=True, stdout=subprocess.DEVNULL)
    with open(folder + "/preset.json", "w", encoding="ascii") as f:
        json.dump(PRESET, f)


def measure(folder):
    """Milliseconds and rmse of each setting, in turn five times, so that what slows the machine slows all."""
    def events(options):
        run = subprocess.run([ctsplat, "render", folder + "/head", "--preset", folder + "/preset.json", *SCENE, *options,
                              "-o", folder + "/a.png"], check=True, stderr=subprocess.PIPE, text=True)
        return [json.loads(line) for line in run.stderr.splitlines() if line.startswith("{")]

    times = [[sum(e["cpu_ms"] for e in events(options) if e["event"] == "stage" and e["stage"] in STAGES)
              for options in SETTINGS] for _ in range(5)]
    errors = [next(e["rmse"] for e in events([*options, "--verify", "4000"]) if e["event"] == "error")
              for options in SETTINGS]
    return [statistics.median(t) for t in zip(*times)], errors


with tempfile.TemporaryDirectory() as work:
    make_series(work)
    took, erred = measure(work)
unit = took[0]
rows = [("ctsplat", " ".join(o).replace("--", "") or "default", t / unit, e) for o, t, e in zip(SETTINGS, took, erred)]
with open(peers, encoding="ascii") as lines:
    others = [json.loads(line) for line in lines]
then = next(p["cpu_ms"] for p in others if p["peer"] == "ctsplat")
scale = took[SETTINGS.index(YARDSTICK)] / then / unit
rows += [(p["peer"], p["setting"], p["cpu_ms"] * scale, p.get("rmse", 10 ** (-p.get("psnr_db", 0) / 20)))
         for p in others if p["peer"] != "ctsplat"]
print("| renderer | setting | processor time | error, rms, of 255 |\n| --- | --- | ---: | ---: |")
for name, setting, time, error in sorted(rows, key=lambda r: r[2]):
    print("| %s | %s | %.2g | %.2g |" % (name, setting, time, 255 * error))
print("(the default took %.2f s, the yardstick %.2f of what it took beside the peers)" % (
    unit / 1000, took[SETTINGS.index(YARDSTICK)] / then))

script = ["set terminal svg noenhanced size 900,520 font 'sans,13' background 'white'", "set logscale xy", "set grid",
          "set xlabel 'processor time of one picture (default of ctsplat = 1)'",
          "set ylabel 'error, rms, of 255 levels'", "set key bottom left", "set xrange [0.03:10]", "set yrange [0.01:15]"]
names = list(dict.fromkeys(r[0] for r in rows))
for i, name in enumerate(names):
    script += ["$d%d << END" % i] + ['%g %g "%s"' % (t, 255 * e, s) for n, s, t, e in rows if n == name] + ["END"]
script.append("plot " + ", ".join(
    "$d%d using 1:2 with points pt %d ps 1.2 lc rgb '%s' title '%s', $d%d using 1:2:3 with labels left rotate by 25 "
    "offset 0.9,0.4 font ',11' notitle" % (i, (7, 4, 8, 10)[i % 4], ("#b3123f", "#1a6f9c", "#8a6d00", "#333333")[i % 4], name, i)
    for i, name in enumerate(names)))
with open(svg, "wb") as out:
    out.write(subprocess.run(["gnuplot", "-"], input="\n".join(script).encode(), check=True, stdout=subprocess.PIPE).stdout)
