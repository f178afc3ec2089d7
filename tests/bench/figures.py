#!/usr/bin/env python3
"""README's figures: processor time and error of one picture by ctsplat and by other renderers. `./dev figures` runs

figures.py CTSPLAT RAW2CT MATRIX.dat PEERS.jsonl PLOT.svg PAGE...

MATRIX.dat: the demo's head (int16, 108 slices of 256 x 256), which is resampled to 512 x 512 x 324 voxels, trilinearly.
PEERS.jsonl: results of other renderers for the same scene, an object per line: peer, setting, cpu_ms of one picture of a volume in
memory, rmse or psnr_db over display values 0..1. The peer `ctsplat` with the setting `engine classic` is the reference measured on
the same machine: all peers' times are scaled by the ratio of its present time to that time. When that engine's code gets faster,
all peers must be measured again.
PAGE: Markdown whose tables are replaced: one of TABLE's rows, one of all rows, one of the paper's.

Times are the least of ROUNDS, in which each setting runs once; errors are those of --verify. man/figures.md describes the method."""
import json
import re
import subprocess
import sys
import tempfile

import numpy

ctsplat, raw2ct, matrix, peers, svg, *pages = sys.argv[1:]
ROUNDS = 5
VERIFIED = 4000  # pixels: some 5 % of the rmse
LEVELS = ["lattice", "sheets", "half-sheets", "hybrid"]  # one that this ctsplat does not have is left out
ERRORS = ["8", "2", "0.5", "0.1"]
YARDSTICK = ("--engine classic", ["--engine", "classic"])
# Groups of the plot: name, and the settings of each: label, options. A level is measured as it is, without correction.
AUTO = [("default" if e == "0.5" else "--max-error " + e, [] if e == "0.5" else ["--max-error", e]) for e in ERRORS]
GROUPS = {
    "ctsplat": AUTO,
    "ctsplat, a further frame": [(label, ["--swivel", "8,2", *options]) for label, options in AUTO[:3]],
    "sheets": [("--level " + l, ["--engine", "sheets", "--level", l, "--max-error", "255"]) for l in LEVELS],
    "march": [("--max-error " + e, ["--engine", "tiled", "--max-error", e]) for e in ERRORS],
    "splatting": [YARDSTICK, ("--engine combined", ["--engine", "combined"])],
}
# README's rows.
TABLE = [("VolPack", "a further view"), ("ctsplat, a further frame", "--max-error 8"), ("ctsplat", "--max-error 8"),
         ("ctsplat", "default"), ("splatting", "--engine classic"), ("VTK, fixed-point", "2 samples a voxel")]
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


def series(folder, name, values, spacing):
    values.astype("<i2").tofile(folder + "/raw")
    size = ",".join(str(n) for n in reversed(values.shape))
    subprocess.run([raw2ct, "--size", size, "--spacing", ",".join("%.10g" % s for s in spacing), "--flip", "y",
                    folder + "/raw", folder + "/" + name], check=True, stdout=subprocess.DEVNULL)


def make_series(folder):
    head = numpy.fromfile(matrix, "<i2").reshape(108, 256, 256)
    series(folder, "demo", head, [0.95703125, 0.95703125, 1.5])
    head = head.astype(numpy.float32)
    for axis, n in enumerate((324, 512, 512)):
        head = finer(head, n, axis)
    series(folder, "head", numpy.rint(head), SPACING)
    with open(folder + "/preset.json", "w", encoding="ascii") as f:
        json.dump(PRESET, f)


def events(folder, options):
    run = subprocess.run([ctsplat, "render", folder + "/head", "--preset", folder + "/preset.json", *SCENE, *options,
                          "-o", folder + "/a.png"], check=False, stderr=subprocess.PIPE, text=True)
    if run.returncode and "no engine has level" not in run.stderr:
        sys.exit(run.stderr)
    return [json.loads(line) for line in run.stderr.splitlines() if line.startswith("{")] if run.returncode == 0 else None


def cpu_ms(log):
    return sum(e["cpu_ms"] for e in log if e["event"] == "stage" and e["stage"] in STAGES)


def measure(folder):
    """Rows of group, setting, milliseconds, rmse, level. The settings take turns, so that what slows the machine slows all."""
    rows = []
    for group, settings in GROUPS.items():
        for label, options in settings:
            log = events(folder, [*options, "--verify", str(VERIFIED)])
            if not log:
                print("left out:", label, file=sys.stderr)
                continue
            # With several frames: the largest.
            rmse = max(e["rmse"] for e in log if e["event"] == "error")
            level = next((e.get("level") or e.get("engine") or "" for e in log if e["event"] == "bound"), "")
            frames = next(e["frames"] for e in log if e["event"] == "picture")
            rows.append({"group": group, "label": label, "options": options, "rmse": rmse, "level": level, "ms": [],
                         "frames": frames})
    for _ in range(ROUNDS):
        for row in rows:
            row["ms"].append(cpu_ms(events(folder, row["options"])))
    for row in rows:
        row["ms"] = min(row["ms"])
    for row in rows:
        if "--swivel" in row["options"]:
            first = next(r["ms"] for r in rows if r["options"] == row["options"][2:])
            row["ms"] = (row["ms"] - first) / (row["frames"] // 2)  # frames of the same view are rendered once
    return rows


def with_peers(rows):
    """Adds the peers' rows; returns the ratio by which their times are scaled."""
    with open(peers, encoding="ascii") as lines:
        others = [json.loads(line) for line in lines]
    scale = next(r["ms"] for r in rows if r["label"] == YARDSTICK[0]) / next(p["cpu_ms"] for p in others if p["peer"] == "ctsplat")
    rows += [{"group": p["peer"], "label": p["setting"], "ms": p["cpu_ms"] * scale, "level": "",
              "rmse": p.get("rmse", 10 ** (-p.get("psnr_db", 0) / 20))} for p in others if p["peer"] != "ctsplat"]
    return scale


def name_of(group):
    return group if group.startswith(("ctsplat", "V")) else "ctsplat, " + group


def small_table(rows, unit):
    lines = ["| renderer | setting | time, 1 = %.2f s | error of 255 |" % (unit / 1000),
             "| --- | --- | ---: | ---: |"]
    chosen = [r for r in rows if (r["group"], r["label"]) in TABLE]
    return lines + ["| %s | %s | %.2g | %.2g |" % (name_of(r["group"]), code(r["label"]), r["ms"] / unit, 255 * r["rmse"])
                    for r in sorted(chosen, key=lambda r: r["ms"])]


def code(label):
    return "`%s`" % label if label.startswith("--") else label


def large_table(rows, unit):
    lines = ["| renderer | setting | level or engine that ran | time, ms | default = 1 | error of 255 |",
             "| --- | --- | --- | ---: | ---: | ---: |"]
    rows = sorted(rows, key=lambda r: r["ms"])
    return lines + ["| %s | %s | %s | %.0f | %.2g | %.2g |" % (name_of(r["group"]), code(r["label"]), r["level"], r["ms"],
                                                               r["ms"] / unit, 255 * r["rmse"]) for r in rows]


PAPER_ROWS = (("similar layers", "layers", "69 (63 to 78)"), ("void voxels", "void", "51"), ("both", "combined", "47 (38 to 58)"))


def paper_table(folder):
    """Time in per cent of plain splatting, of bone and skin: the rows of bench --paper as the paper has it, and as they are."""
    found = {}
    for preset in "bone", "skin":
        run = subprocess.run([ctsplat, "bench", "--paper", folder + "/demo", "--preset", preset], check=True,
                             stdout=subprocess.PIPE, text=True)
        for line in run.stdout.splitlines():
            cells = re.match(r"(classic|layers|void|combined)(.*?) +[\d.]+ +([\d.]+) ", line)
            if cells:
                found.setdefault(cells[1], {}).setdefault(preset, []).append(float(cells[3]))
    lines = ["| time in per cent of plain splatting | published | as in the paper | ctsplat's default |",
             "| --- | ---: | ---: | ---: |"]
    for name, engine, published in PAPER_ROWS:
        theirs, ours = ([found[engine][preset][k] for preset in ("bone", "skin")] for k in (0, 1))
        lines.append("| %s | %s | %.0f and %.0f | %.0f and %.0f |" % (name, published, *theirs, *ours))
    return lines


def replace_table(page, table):
    """Replaces the page's table whose header has the same words."""
    def words(line):
        return re.sub(r"[\d.]+ s", "", line)

    with open(page, encoding="utf-8") as f:
        lines = f.read().split("\n")
    begin = next((i for i, line in enumerate(lines) if words(line) == words(table[0])), None)
    if begin is None:
        return
    end = begin
    while end < len(lines) and lines[end].startswith("|"):
        end += 1
    lines[begin:end] = table
    with open(page, "w", encoding="utf-8") as f:
        f.write("\n".join(lines))


# Places of labels in the plot, where it is not above and to the right of the point.
PLACES = {"sheets": "right offset -0.9,-0.3", "march": "right offset -0.9,-0.6"}
# Points of one group that are closer than these ratios share a label: 14 pixels of the plot, a label's height.
SAME_PLACE = {"ms": 1.17, "rmse": 1.24}


def joined_labels(points):
    """Labels of a group's points, which are sorted by time; "" where the label before it has the name too."""
    labels = []
    last = None  # index of the last point with a label
    for i, r in enumerate(points):
        if last is not None and all(
                max(r[key], points[last][key]) < limit * min(r[key], points[last][key])
                for key, limit in SAME_PLACE.items()):
            labels[last] += ", " + short(r)
            labels.append("")
        else:
            labels.append(short(r))
            last = i
    return labels


def plot(rows, unit):
    script = ["set terminal svg noenhanced size 900,600 font 'sans,15' background 'white'", "set logscale xy", "set grid",
              "set xlabel 'processor time of one picture (default of ctsplat = 1, %.2f s)'" % (unit / 1000),
              "set ylabel 'error, rms, of 255 levels'", "set key bottom left reverse Left samplen 2",
              "set yrange [0.01:20]", "set offsets graph 0.02, graph 0.2, 0, 0"]
    looks = {"ctsplat": (7, "#b3123f", True), "ctsplat, a further frame": (7, "#e07b39", True),
             "sheets": (5, "#7a3ea8", False), "march": (9, "#1a6f9c", True),
             "splatting": (11, "#666666", False)}
    parts = []
    for i, group in enumerate(dict.fromkeys(r["group"] for r in rows)):
        points = sorted((r for r in rows if r["group"] == group), key=lambda r: r["ms"])
        script += ["$d%d << END" % i] + ['%g %g "%s"' % (r["ms"] / unit, 255 * r["rmse"], label)
                                         for r, label in zip(points, joined_labels(points))] + ["END"]
        shape, colour, lines = looks.get(group, (13 if "VTK" in group else 15, "#8a6d00" if "VTK" in group else "#2c7a3f", False))
        style = "linespoints" if lines else "points"
        # Levels and the march lie beside the settings that chose them: their labels are on the other side.
        place = PLACES.get(group, "left rotate by 35 offset 0.6,0.5")
        parts += ["$d%d using 1:2 with %s pt %d ps 1.1 lc rgb '%s' title '%s'" % (i, style, shape, colour, name_of(group)),
                  "$d%d using 1:2:3 with labels %s font ',12' tc rgb '%s' notitle" % (i, place, colour)]
    script.append("plot " + ", ".join(parts))
    with open(svg, "wb") as out:
        out.write(subprocess.run(["gnuplot", "-"], input="\n".join(script).encode(), check=True, stdout=subprocess.PIPE).stdout)


def short(row):
    return row["label"].replace("--max-error ", "").replace("--level ", "").replace("--engine ", "")


with tempfile.TemporaryDirectory() as work:
    make_series(work)
    all_rows = measure(work)
    papers = paper_table(work)
ratio = with_peers(all_rows)
one = next(r["ms"] for r in all_rows if r["label"] == "default" and r["group"] == "ctsplat")
tables = [small_table(all_rows, one), large_table(all_rows, one), papers]
for table in tables:
    print("\n".join(table) + "\n")
    for page in pages:
        replace_table(page, table)
print("(%s took %.2f of its time beside the peers)" % (YARDSTICK[0], ratio))
plot(all_rows, one)
