#!/usr/bin/env python3
"""Batches that are resumed, killed, sharded, starved and fed with bad series: batch.py CTSPLAT TESTDATA FOLDER WHAT...
[--series N] [--kills N] [--seed N]. WHAT are names of the tests below, without test_."""
import argparse
import glob
import hashlib
import json
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
import zipfile

OPTIONS = ["--size", "48x48", "--presets", "bone,skin", "--views", "anterior,30,-20", "--formats", "png,dcm"]
N_OUTPUTS = 8
N_FILES = N_OUTPUTS + 5  # with four previews, and the sections of the volume


def check(condition, *words):
    if not condition:
        raise SystemExit("FAIL: " + " ".join(str(w) for w in words))


class Batch:
    def __init__(self, args):
        self.args = args
        self.uid = json.loads(self.run("info", self.small(), "--json").stdout)["series"][0]["series_uid"].encode()
        self.env = dict(os.environ, SOURCE_DATE_EPOCH="1000000000")

    def small(self):
        return os.path.join(self.args.testdata, "syntax", "explicit")

    def run(self, *words, **more):
        return subprocess.run([self.args.ctsplat, *words], stdin=subprocess.DEVNULL, capture_output=True, text=True,
                              env=getattr(self, "env", None), **more)

    def start(self, *words, **more):
        return subprocess.Popen([self.args.ctsplat, *words], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                                stderr=subprocess.PIPE, text=True, env=self.env, **more)

    def name(self, i):
        """Another UID of the same length."""
        tail = b"%06d" % i
        return self.uid[:-7] + b"7" + tail

    def add(self, archive, i, change=None):
        """Series i, whose files change(bytes, slice) may damage; None leaves a file out."""
        folder = os.path.join(archive, "series%d" % i)
        os.makedirs(folder)
        for k, path in enumerate(sorted(glob.glob(os.path.join(self.small(), "*")))):
            with open(path, "rb") as f:
                data = f.read().replace(self.uid, self.name(i))
            if change:
                data = change(data, k)
            if data is not None:
                with open(os.path.join(folder, "%03d.dcm" % k), "wb") as f:
                    f.write(data)
        return self.name(i).decode()

    def archive(self, name, n, bad=0):
        """n series, of which the first `bad` cannot be rendered."""
        for i in range(n):
            spacing = lambda data, k: data.replace(b"8\\9", b"0\\9").replace(b"9\\8", b"0\\8")
            self.add(name, i, spacing if i < bad else None)
        return name

    def lines(self, folder):
        found = {}
        for path in glob.glob(os.path.join(folder, "batch*.jsonl")):
            with open(path) as f:
                for text in f:
                    line = json.loads(text)
                    found[line["series_uid"]] = line
        return found

    def outputs(self, folder):
        """All outputs, by hash; any other file that a run leaves is an error."""
        found = {}
        for root, _, names in os.walk(folder):
            for name in names:
                path = os.path.join(root, name)
                check(not name.endswith(".tmp"), "left behind:", path)
                if root != folder:
                    with open(path, "rb") as f:
                        found[os.path.relpath(path, folder)] = hashlib.sha256(f.read()).hexdigest()
        return found

    def ok(self, code, *words):
        done = self.run("batch", *words)
        check(done.returncode == code, "exit code", done.returncode, "not", code, words, done.stderr[-2000:])
        check(done.stdout == "", "prints", done.stdout[:200])
        return done


def times(folder):
    return {path: os.stat(path).st_mtime_ns for path in glob.glob(folder + "/*/*") if os.path.isfile(path)}


def children(pid):
    with open("/proc/%d/task/%d/children" % (pid, pid)) as f:
        return [int(word) for word in f.read().split()]


def test_plain(b):
    """Pictures as `render` makes them; bad series are written down."""
    archive = b.archive("plain", 5, bad=1)
    b.add(archive, 77, lambda data, k: None if 2 <= k < 7 else data)
    with open(archive + "/notes.txt", "w") as f:
        f.write("not DICOM")
    # An unreadable file is reported with the series in its folder; without one, it has a record of its own.
    b.add(archive, 88, lambda data, k: data[:160] + b"\xff" * 40 if k == 9 else data)
    b.add(archive, 99, lambda data, k: data[:160] + b"\xff" * 40 if k < 3 else None)
    b.ok(8, archive, "-O", "o", *OPTIONS)
    lines = b.lines("o")
    check(len(lines) == 8, "lines:", list(lines))
    beside = lines[b.name(88).decode()]
    check(beside["status"] == "done" and "unreadable_file" in [f["code"] for f in beside["findings"]], beside)
    alone = [line for uid, line in lines.items() if uid.startswith("uid-")]
    check(len(alone) == 1 and alone[0]["status"] == "refused" and alone[0]["exit_code"] == 3, alone)
    outputs = b.outputs("o")
    for i in range(5):
        line = lines[b.name(i).decode()]
        check(line["status"] == ("refused" if i < 1 else "done"), line)
        check(bool(line["reason"]) == (i < 1) and line["exit_code"] == (4 if i < 1 else 0), line)
        check(len(line["outputs"]) == (0 if i < 1 else N_OUTPUTS), line)
        for output in line["outputs"]:
            check(outputs[output["path"]] == output["sha256"], output)
            check(os.path.getsize("o/" + output["path"]) == output["bytes"], output)
        check(len(line["thumbnails"]) == (0 if i < 1 else 5), line)  # four pictures, and the sections
        check(i < 1 or line["geometry"]["dims"] == [28, 24, 10] and "description" not in line["geometry"], line)
        check(i < 1 or set(line["stages"]) > {"scan", "decode", "export"}, line)
    check(lines[b.name(77).decode()]["status"] in ("refused", "failed"), lines[b.name(77).decode()])
    uid = b.name(3).decode()
    done = b.run("render", archive + "/series3", "--size", "48x48", "-p", "skin", "--view", "30,-20", "-o", "r.png",
                 "-o", "r.dcm")
    check(done.returncode == 0, done.stderr)
    for ending in "png", "dcm":
        with open("r." + ending, "rb") as f, open("o/%s/skin-30,-20.%s" % (uid, ending), "rb") as g:
            check(f.read() == g.read(), "not what render makes:", ending)
    check(os.path.isfile("o/index.html"), "no contact sheet")


def test_resume(b):
    """Only changed inputs are rendered again."""
    archive = b.archive("resume", 4)
    words = [archive, "-O", "o", *OPTIONS]
    b.ok(0, *words)
    first, hashes = times("o"), b.outputs("o")
    check(len(first) == 4 * N_OUTPUTS, len(first))
    b.ok(0, *words)
    check(times("o") == first, "rendered again")
    # Files that are gone or damaged.
    gone, damaged = sorted(first)[3], sorted(first)[10]
    os.remove(gone)
    with open(damaged, "r+b") as f:
        f.seek(100)
        f.write(b"\0\1\2")
    b.ok(0, *words)
    second = times("o")
    check({p for p in first if second[p] != first[p]} == {gone, damaged}, "other files were made")
    check(b.outputs("o") == hashes, "not the same bytes")
    # An option that touches .dcm files alone, another preset, another view.
    b.ok(0, *words, "--compress", "rle")
    third = times("o")
    check({p for p in first if third[p] != second[p]} == {p for p in first if p.endswith(".dcm")}, "--compress")
    more = [w.replace("bone,skin", "bone,muscle,skin") for w in words] + ["--compress", "rle"]
    b.ok(0, *more)
    fourth = times("o")
    check(len(fourth) == 4 * N_OUTPUTS * 3 // 2 and all(fourth[p] == third[p] for p in third), "another preset")
    # Other notation, another order, or an explicit default is no change.
    same = more[:more.index("--compress")] + ["--compress=rle", "--fit", "visible", "--engine", "auto", "--kernel",
                                              "tent", "--mode", "composite", "--background", "#000000", "--shade", "on",
                                              "--remove-table=on", "--annotate", "none"]
    at = same.index("--size")
    b.ok(0, *(same[:at] + same[at + 2:] + ["--size", "48x48"]))
    check(times("o") == fourth, "rendered again for the same options")
    window = b.run("batch", *more, "--window", "0,900")
    check(window.returncode == 0 and all(times("o")[p] != fourth[p] for p in fourth), "--window")
    b.ok(0, *more)
    fourth = times("o")
    # Another format is written beside the existing files.
    exr = [w.replace("png,dcm", "png,dcm,exr") for w in more]
    b.ok(0, *exr)
    check(len(times("o")) == len(fourth) * 3 // 2 and all(times("o")[p] == fourth[p] for p in fourth), "another format")
    for path in glob.glob("o/*/*.exr"):
        os.remove(path)
    # A picture of an older version that is not asked for again stays, and the sheet says so.
    with open("o/batch.jsonl") as f:
        text = f.read()
    with open("o/batch.jsonl", "w") as f:
        f.write("".join(json.dumps({**line, "outputs": [{**o, "version": "0.0.1"} if o["preset"] == "muscle" else o
                                                        for o in line["outputs"]]}) + "\n"
                        for line in map(json.loads, text.splitlines())))
    b.ok(0, *words, "--compress", "rle")
    with open("o/index.html") as f:
        sheet = f.read()
    check(sheet.count("other_version") == 4 and "rendered by ctsplat 0.0.1" in sheet, "a note on older pictures")
    # Another size touches all.
    b.ok(0, *[w.replace("48x48", "40x40") for w in more])
    check(all(times("o")[p] != fourth[p] for p in fourth), "another size")
    b.ok(0, *words)
    fifth = times("o")
    # One input, a new series, and one that is gone.
    os.utime(archive + "/series2/004.dcm")
    b.add(archive, 9)
    shutil.rmtree(archive + "/series0")
    b.ok(0, *words)
    sixth, lines = times("o"), b.lines("o")
    touched = {p.split("/")[1] for p in sixth if sixth[p] != fifth.get(p)}
    check(touched == {b.name(2).decode(), b.name(9).decode()}, touched)
    check(len(lines) == 5 and all(line["status"] == "done" for line in lines.values()), "lines")
    b.ok(0, *words, "--fresh")
    seventh = times("o")
    check(all(seventh[p] != sixth[p] for p in sixth if b.name(0).decode() not in p and "muscle" not in p), "--fresh")


def phases(b):
    return os.path.join(b.args.testdata, "geometry", "two-phases")


def test_journal(b):
    """A record's contents: errors, times and memory, as in the log; and the sums are consistent."""
    archive = b.archive("journal", 3, bad=1)
    b.ok(8, archive, "-O", "o", *OPTIONS, "--verify", "50", "--log", "log")
    lines = b.lines("o")
    with open("log") as f:
        log = [json.loads(text) for text in f]
    check(sum(e["event"] == "run" for e in log) == 2 and sum(e["event"] == "done" for e in log) == 2, "log")
    for i in range(1, 3):
        line = lines[b.name(i).decode()]
        check(len(line["errors"]) == 4, line)
        for error in line["errors"]:
            check(error["pixels"] == 50 and 0 <= error["rmse"] <= error["max"] <= 1, error)
        check({(e["preset"], e["view"]) for e in line["errors"]} ==
              {(p, v) for p in ("bone", "skin") for v in ("anterior", "30,-20")}, line["errors"])
        check(line["peak_rss_bytes"] > 1 << 20 and line["cpu_ms"] >= 0, line)
        check(line["geometry"]["hu_max"] > line["geometry"]["hu_min"] and len(line["geometry"]["box_mm"]) == 6, line)
    # Pictures rendered again without --verify have no errors; unchanged ones keep theirs.
    known = {uid: line.get("errors") for uid, line in lines.items()}
    b.ok(8, archive, "-O", "o", *OPTIONS)
    check({uid: line.get("errors") for uid, line in b.lines("o").items()} == known, "errors of what stands")
    b.ok(8, archive, "-O", "o", *[w.replace("png,dcm", "png,exr,dcm") for w in OPTIONS])
    check(not any(line.get("errors") for line in b.lines("o").values()), "errors of pictures rendered again without --verify")
    # Findings about the pictures of a preset are recorded with it, as long as the pictures are kept.
    for presets in "bone", "bone,skin", "skin":
        b.ok(0, phases(b), "-O", "f", "--size", "48x48", "--window", "0,1", "--presets", presets, "--crop", "-9,9,-9,9,-9,9")
        for line in b.lines("f").values():
            found = [f.get("preset") for f in line["findings"] if f["code"] == "nothing_visible"]
            check(found == ["bone"], presets, line["findings"])
    # The files of one UID may be several series, each of which counts.
    for before in 0, 3:
        said = b.ok(8, phases(b), archive, "-O", "s", *OPTIONS).stderr.strip().split("\n")[-1]
        numbers = [int(word) for word in re.findall(r"\b[0-9]+\b", said)]
        expected = [4, 5] + ([4] if before else []) + [1, 0]
        check(numbers == expected and len(b.lines("s")) == 5, said)


def test_zip(b):
    """A zip file of many series gives what its folder gives, beside a folder too, and nothing is made twice."""
    archive = b.archive("zipped", 5, bad=1)
    with zipfile.ZipFile("a.zip", "w", zipfile.ZIP_DEFLATED) as z:
        for path in glob.glob(archive + "/*/*"):
            z.write(path)
    b.add("beside", 7)
    b.ok(8, "a.zip", "beside", "-O", "z", *OPTIONS)
    first = times("z")
    b.ok(8, archive, "beside", "-O", "o", *OPTIONS)
    check(b.outputs("z") == b.outputs("o") and len(b.lines("z")) == 6, "zip and folder differ")
    reason = b.lines("z")[b.name(0).decode()]["reason"]
    check(reason == b.lines("o")[b.name(0).decode()]["reason"], reason)
    b.ok(8, "a.zip", "beside", "-O", "z", *OPTIONS)
    check(times("z") == first, "rendered again")


def test_kill(b):
    """kill -9 at any moment, and the outputs of the next run are those of an undisturbed one."""
    r = random.Random(b.args.seed)
    archive = b.archive("kill", b.args.series, bad=1)
    words = [archive, "-O", "o", *OPTIONS]
    start = time.time()
    b.ok(8, archive, "-O", "good", *OPTIONS)
    took = time.time() - start
    expected = b.outputs("good")
    for i in range(b.args.kills):
        if i % 10 == 0:
            shutil.rmtree("o", ignore_errors=True)
        run = b.start("batch", *words)
        time.sleep(r.uniform(0, took * r.choice([0.2, 1.1])))
        run.kill()
        run.communicate()
        known = {}
        for uid, line in b.lines_torn("o").items():
            if line["status"] == "done":
                known.update({o["path"]: o["sha256"] for o in line["outputs"]})
        there = {p: h for p, h in b.hashes("o").items()}
        for path, digest in known.items():
            check(there.get(path) == digest, "the journal lists a missing or changed file:", path)
        for path, digest in there.items():
            check("/." in path or digest == expected[path], "half a file:", path)
        if i % 10 in (3, 9) or i == b.args.kills - 1:
            stood = {p: os.stat("o/" + p).st_mtime_ns for p in known}
            b.ok(8, *words)
            check(b.outputs("o") == expected, "other outputs after kill", i)
            check(all(os.stat("o/" + p).st_mtime_ns == t for p, t in stood.items()), "done twice after kill", i)
            check(all(line["status"] == "done" for uid, line in b.lines("o").items() if uid != b.name(0).decode()), i)


def test_lock(b):
    """A second batch on one DIR ends with a message."""
    archive = b.archive("lock", 4)
    first = b.start("batch", archive, "-O", "o", *OPTIONS)
    while not os.path.exists("o/batch.jsonl"):
        time.sleep(0.01)
    first.send_signal(signal.SIGSTOP)
    second = b.run("batch", archive, "-O", "o", *OPTIONS)
    check(second.returncode == 1 and "another batch is running" in second.stderr, second.stderr)
    third = b.run("batch", archive, "-O", "o", "--shard", "0/2", *OPTIONS)
    check(third.returncode == 1 and "running there" in third.stderr, third.stderr)
    first.send_signal(signal.SIGCONT)
    check(first.wait() == 0, first.stderr.read())
    check(len(b.outputs("o")) == 4 * N_FILES, "outputs")


def test_shards(b):
    """Shards share DIR, each series is one's, and their union is the whole."""
    archive = b.archive("shards", 9, bad=1)
    b.ok(8, archive, "-O", "whole", *OPTIONS)
    runs = [b.start("batch", archive, "-O", "o", "--shard", "%d/3" % i, *OPTIONS) for i in range(3)]
    codes = [run.wait() for run in runs]
    check(sorted(codes) == [0, 0, 8], codes)
    check(b.outputs("o") == b.outputs("whole"), "not the same as without shards")
    seen = []
    for path in glob.glob("o/batch-*-of-3.jsonl"):
        with open(path) as f:
            seen += [json.loads(line)["series_uid"] for line in f]
    check(sorted(seen) == sorted(b.name(i).decode() for i in range(9)), seen)
    check(not os.path.exists("o/index.html"), "a shard made the page")
    b.ok(0, "--merge", "o")
    check(os.path.isfile("o/index.html"), "no page")
    # Another number of shards, and none, go on from there.
    before = times("o")
    codes = [b.run("batch", archive, "-O", "o", "--shard", "%d/2" % i, *OPTIONS).returncode for i in range(2)]
    check(sorted(codes) == [0, 8], codes)
    b.ok(8, archive, "-O", "o", *OPTIONS)
    check(times("o") == before, "rendered again")


def test_bad(b):
    """Too slow, too large, crashed, removed: each with its reason, and the batch continues."""
    archive = b.archive("bad", 3)
    b.ok(8, archive, "-O", "slow", "--series-timeout", "0.001", *OPTIONS)
    for line in b.lines("slow").values():
        check(line["status"] == "failed" and "--series-timeout" in line["reason"], line)
    b.outputs("slow")
    b.ok(0, archive, "-O", "slow", *OPTIONS)
    if b.run("batch", archive, "-O", "large", "--series-memory", "1", *OPTIONS).returncode == 8: # not under sanitizers
        for line in b.lines("large").values():
            check(line["status"] == "failed" and "memory" in line["reason"], line)
    # A process that crashes.
    many = b.archive("many", 12)
    run = b.start("batch", many, "-O", "o", "--jobs", "1", *OPTIONS)
    crashed = 0
    seen = {}
    while run.poll() is None and not crashed:
        for pid in children(run.pid):
            try:
                # A worker process is a fork of the batch. A reader becomes another program, soon.
                if time.monotonic() - seen.setdefault(pid, time.monotonic()) > 0.03 and os.path.basename(os.readlink("/proc/%d/exe" % pid)) == "ctsplat":
                    os.kill(pid, signal.SIGUSR2)  # a sanitizer would catch SIGSEGV
                    crashed += 1
            except (ProcessLookupError, FileNotFoundError):
                pass
    shutil.rmtree(many + "/series11", ignore_errors=True) # gone, or late
    messages = run.communicate()[1]
    check(run.returncode == 8, run.returncode, messages)
    failed = [line for line in b.lines("o").values() if line["status"] == "failed"]
    check(any("crashed" in line["reason"] for line in failed), failed, messages)
    check(len(b.lines("o")) == 12, len(b.lines("o")))
    b.outputs("o")


def test_signals(b):
    """SIGTERM and SIGINT: exit 130 soon, no partial files, and the next run resumes."""
    archive = b.archive("signals", 8)
    for i, name in enumerate((signal.SIGTERM, signal.SIGINT)):
        run = b.start("batch", archive, "-O", "o%d" % i, *OPTIONS,
                      preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler))
        while run.poll() is None and not glob.glob("o%d/*/*.png" % i):
            time.sleep(0.01)
        run.send_signal(name)
        messages = run.communicate()[1]
        if run.returncode:
            check(run.returncode == 130, run.returncode, messages)
            check(messages.count("error: interrupted") == 1, messages)
        b.outputs("o%d" % i)
        b.ok(0, archive, "-O", "o%d" % i, *OPTIONS)
        check(len(b.outputs("o%d" % i)) == 8 * N_FILES, "outputs")


def test_outputs(b):
    """A folder that takes no files ends the batch with 5 before any series, or as soon as it is full."""
    archive = b.archive("outputs", 3)
    with open("file", "w"):
        pass
    for folder in "file", "file/below", "missing/below":
        done = b.run("batch", archive, "-O", folder, *OPTIONS)
        check(done.returncode == 5 and done.stderr.count("error:") == 1, done.returncode, done.stderr)
    check(b.run("batch", archive, "-O", archive, *OPTIONS).returncode == 2, "into the archive")
    done = subprocess.run([b.args.ctsplat, "batch", archive, "-O", "o", *OPTIONS], capture_output=True, text=True,
                          env=b.env, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096)))
    check(done.returncode == 5 and done.stderr.count("error:") == 1, done.returncode, done.stderr)
    b.outputs("o")
    b.ok(0, archive, "-O", "o", *OPTIONS)
    # Options that would fail for any series are refused before any output is changed.
    before = times("o")
    for words, code, said in ((["--engine", "classic", "--slab", "10"], 2, "slab"), (["--log", "none/log"], 5, "none/log"),
                              (["--series", "1.2.3"], 2, "1.2.3")):
        done = b.run("batch", archive, "-O", "o", *OPTIONS, *words)
        check(done.returncode == code and said in done.stderr and done.stderr.count("error:") == 1, words, done.stderr)
    check(times("o") == before, "touched")
    b.ok(0, archive, "-O", "o", *OPTIONS, "--fresh", "--log", "/dev/full")
    check(all("log_lost" in [f["code"] for f in line["findings"]] for line in b.lines("o").values()), "log_lost")
    os.mkdir("empty")
    check(b.run("batch", "empty", "-O", "none").returncode == 3, "no series")
    check(b.run("batch", "absent", "-O", "none").returncode == 3, "no input")


def test_passed(b):
    """Scouts, dose pages, single slices and what is watched at one place are no failures."""
    # A page: derived, and without a position; the part of the file before it keeps its length.
    def page(data, k):
        for tag in b"\x20\x00\x32\x00", b"\x20\x00\x37\x00", b"\x20\x00\x52\x00":
            at = data.index(tag + (b"UI" if tag[2] == 0x52 else b"DS"))
            data = data[:at] + data[at + 8 + int.from_bytes(data[at + 6:at + 8], "little"):]
        return data.replace(b"ORIGINAL\\PRIMARY\\AXIAL", b"DERIVED\\SECONDARY\\PAGE") if k < 3 else None
    scout = lambda data, k: data.replace(b"ORIGINAL\\PRIMARY\\AXIAL", b"DERIVED\\PRIM\\LOCALIZER") if k < 2 else None
    for i, change in enumerate((None, scout, lambda data, k: data if k == 4 else None, page)):
        b.add("passed", i, change)
    b.ok(0, "passed", "-O", "o", *OPTIONS)
    lines = b.lines("o")
    states = [lines[b.name(i).decode()]["status"] for i in range(4)]
    check(states == ["done", "thumbnail", "thumbnail", "thumbnail"], states, lines)
    for i, word in (1, "scouts"), (2, "1 slice"), (3, "pages"):
        check(word in lines[b.name(i).decode()]["reason"], lines[b.name(i).decode()]["reason"])
    said = b.ok(0, "passed", "-O", "o", *OPTIONS).stderr
    check("1 of 4 series done (1 of them in earlier runs), 3 thumbnails" in said, said)
    b.ok(0, "passed/series2", "-O", "alone", *OPTIONS)
    # One that is refused beside them still counts.
    b.add("passed", 9, lambda data, k: data.replace(b"8\\9", b"0\\9").replace(b"9\\8", b"0\\8"))
    b.ok(8, "passed", "-O", "o", *OPTIONS)
    info = json.loads(b.run("info", "passed", "--json").stdout)["series"]
    check(sorted((s["passed"], s["renderable"]) for s in info) == [(False, False), (False, True)] + [(True, False)] * 3,
          info)


def test_single_slices(b):
    """A scan whose slices each have a SeriesInstanceUID: thumbnails, with one note on stderr and one in each record."""
    others = lambda n: "and %d others are %d single slices that lie as one stack" % (n - 1, n)
    for i in range(9):
        b.add("singles", i, lambda data, k: data if k == i else None)
    shutil.copytree("singles/series3", "singles/copy")  # the same slice twice is still one
    b.add("singles", 20)  # a volume of the same study
    said = b.ok(0, "singles", "-O", "o", *OPTIONS).stderr
    check(said.count("single slices") == 1 and others(9) in said and "9 thumbnails" in said, "one note of 9 slices:", said)
    notes = lambda i: [f for f in b.lines("o")[b.name(i).decode()]["findings"] if f["code"] == "single_slices"]
    check(all(len(notes(i)) == 1 and others(9) in notes(i)[0]["text"] and notes(i)[0]["severity"] == "note"
              for i in range(9)), [notes(i) for i in range(9)])
    check(not notes(20), "note on a volume:", notes(20))
    # Records follow a stack that has grown, and each shard sees all of it.
    b.add("singles", 9, lambda data, k: data if k == 9 else None)
    b.ok(0, "singles", "-O", "o", *OPTIONS)
    check(all(others(10) in notes(i)[0]["text"] for i in range(10)), [notes(i) for i in range(10)])
    said = [b.ok(0, "singles", "-O", "s", *OPTIONS, "--shard", "%d/3" % i).stderr for i in range(3)]
    check(sum(text.count(others(10)) for text in said) == 1, "one note in three shards:", said)
    info = json.loads(b.run("info", "singles", "--json").stdout)
    found = [f["text"] for f in info["findings"] if f["code"] == "single_slices"]
    check(len(found) == 1 and others(10) in found[0], "info: one note of 10 slices:", info["findings"])
    # Two slices, one place, and uneven steps are no stack.
    for name, slices in ("two", (2, 3)), ("place", (4, 4, 4)), ("uneven", (0, 1, 3, 7)):
        for i, n in enumerate(slices):
            b.add(name, i, lambda data, k: data if k == n else None)
        said = b.ok(0, name, "-O", "o-" + name, *OPTIONS).stderr
        check("single slices" not in said, name, "noted as a stack:", said)


def sheet(folder):
    """The data of the contact sheet."""
    with open(folder + "/index.html", encoding="utf-8") as f:
        return json.loads(f.read().split('id="data">')[1].split("</script>")[0])


def test_paths(b):
    """Names of input files and folders are kept only on request, like descriptions and dates."""
    archive = "DOE JOHN 1950"
    def keep(data, k):
        return data
    b.add(archive, 0, lambda data, k: data[:-700] if k == 5 else data)  # a slice that is cut short: left out
    b.add(archive, 1, lambda data, k: data[:-700])                      # all of them: refused
    b.add(archive, 2, lambda data, k: data[:160] + b"\xff" * 40 if k == 9 else data)
    b.add(archive, 3, lambda data, k: data[:160] + b"\xff" * 40 if k < 3 else None)
    with zipfile.ZipFile("ROE RICHARD.zip", "w") as z:
        b.add("zipped", 5, lambda data, k: data[:-700] if k == 5 else data)
        for path in glob.glob("zipped/*/*"):
            z.write(path, "ROE R/" + os.path.basename(path).replace("00", "SLICE"))
    names = ["DOE", "JOHN", "ROE", "RICHARD", "series0", "series1", "series2", "005.dcm", "009.dcm", "SLICE"]
    words = [archive, "ROE RICHARD.zip", "-O", "o", *OPTIONS, "--log", "log"]

    def kept():
        texts = {}
        for path in "o/batch.jsonl", "o/index.html", "log":
            with open(path, encoding="utf-8") as f:
                texts[path] = f.read()
        return texts
    done = b.ok(8, *words)
    check("000.dcm" in done.stderr and "DOE JOHN" in done.stderr, "messages name files", done.stderr)
    for path, text in kept().items():
        check(not [n for n in names if n in text], path, [n for n in names if n in text])
        check("PixelData" in text, path, "the reason does not name the fault")
        check("phantom" not in text.replace("--fit", "") or path == "o/index.html", path)
    lines = b.lines("o")
    bad = [f for f in lines[b.name(0).decode()]["findings"] if f["code"] == "bad_slices"]
    check(len(bad) == 1 and bad[0]["text"].startswith("truncated"), bad)
    check("study_date" not in lines[b.name(0).decode()]["geometry"], lines)
    # On request existing records get them too; the next run removes them.
    before = times("o")
    b.ok(8, *words, "--show-paths", "--show-patient")
    check(times("o") == before, "rendered again")
    journal, page, log = kept().values()
    for text in journal, page:
        check(all(n in text for n in ("DOE JOHN 1950/series0", "DOE JOHN 1950/series1", "ROE RICHARD.zip")), text[:300])
    line = b.lines("o")[b.name(0).decode()]
    check(line["sources"] == [{"folder": archive + "/series0", "first": "000.dcm", "files": 10}], line["sources"])
    check(line["geometry"]["study_date"] == "2000-01-01" and line["geometry"]["series_number"] == 1, line["geometry"])
    check(b.lines("o")[b.name(1).decode()]["reason_file"] == "000.dcm", b.lines("o")[b.name(1).decode()])
    os.remove("log")
    b.ok(8, *words, "--fresh", "--show-paths")
    check("005.dcm" in kept()["log"], "the log does not name files")
    files = [f.get("files") for f in b.lines("o")[b.name(0).decode()]["findings"] if f["code"] == "bad_slices"]
    check(files == [["005.dcm"]], files)
    os.remove("log")
    b.ok(8, *words)
    for path in "o/batch.jsonl", "o/index.html":
        check(not [n for n in names if n in kept()[path]], path, "still names", [n for n in names if n in kept()[path]])
    # render's log leaves them out as well.
    for more, named in ((), False), (("--show-paths",), True):
        b.run("render", archive + "/series0", "--size", "16x16", "-o", "x.png", "--force", "--log", "log%d" % named, *more)
        with open("log%d" % named) as f:
            text = f.read()
        check(("005.dcm" in text) == named and "truncated" in text, "render's log", named, text[:300])
    failed = b.run("render", "no such DOE", "-o", "x.png", "--force", "--log", "log2")
    with open("log2") as f:
        check(failed.returncode == 3 and "DOE" in failed.stderr and "DOE" not in f.read(), "a missing input")


def test_lost(b):
    """An unreadable file is shown on the card of the only series in its folder, and on none if there are two."""
    broken = lambda data: data[:160] + b"\xff" * 40
    os.makedirs("flat")
    for i in range(2):
        b.add("two", i)
        for path in glob.glob("two/series%d/*" % i):
            shutil.copy(path, "flat/%d-%s" % (i, os.path.basename(path)))
    with open("two/series0/003.dcm", "rb") as f:
        data = f.read()
    with open("flat/lost.dcm", "wb") as f:
        f.write(broken(data))
    for words in (), ("--shard", "0/1"):
        b.ok(8, "flat", "-O", "o%d" % len(words), *OPTIONS, *words)
        lines = b.lines("o%d" % len(words))
        codes = {uid: [f["code"] for f in line["findings"] if "file" in f["code"]] for uid, line in lines.items()}
        check(all(not codes[b.name(i).decode()] for i in range(2)), codes)
        own = [line for uid, line in lines.items() if uid.startswith("uid-")]
        check(len(own) == 1 and own[0]["status"] == "refused" and "lost" not in json.dumps(own[0]), own)
    codes = [b.run("batch", "flat", "-O", "s", "--shard", "%d/3" % i, *OPTIONS).returncode for i in range(3)]
    check(sorted(codes) == [0, 0, 8] and len(b.lines("s")) == 3, codes)
    check(all("unreadable_file" not in json.dumps(line["findings"]) for line in b.lines("s").values()), "in shards")
    with open("two/series0/zzz.dcm", "wb") as f:
        f.write(broken(data))
    b.ok(0, "two", "-O", "t", *OPTIONS)
    lines = b.lines("t")
    reported = ["unreadable_file" in [f["code"] for f in lines[b.name(i).decode()]["findings"]] for i in range(2)]
    check(reported == [True, False], lines)


def test_sheet(b):
    """The sheet is there and right while the batch runs, and after kill -9. It is renewed at least every 10 s: where disks
    are so slow that a batch ends before, a longer one is tried."""
    words = [w.replace("48x48", "192x192") for w in OPTIONS]
    made = 0
    for n in (16, 64, 256):
        for i in range(made, n):
            b.add("sheet", i)
        made, folder = n, "o%d" % n
        began = time.monotonic()
        run = b.start("batch", "sheet", "-O", folder, *words, "--jobs", "1", "--threads", "1")
        seen = []
        while run.poll() is None and len(seen) < 3:
            if os.path.exists(folder + "/index.html"):
                data, journal = sheet(folder), b.lines_torn(folder)
                if "run" in data and (not seen or data["run"]["ended"] > seen[-1]["run"]["ended"]):
                    seen.append(data)
                for s in data["series"]:
                    check(s["series_uid"] in journal, "the sheet lists a series that is not in the journal")
            time.sleep(0.05)
        seconds = time.monotonic() - began
        run.kill()
        run.communicate()
        if len(seen) > 1 or seconds > 60:
            break
    check(len(seen) > 1, "%d sheets in %.0f s, expected more than 1" % (len(seen), seconds))
    for data in seen:
        check(data["run"]["series"] == n and data["run"]["goes_on"], "the total is not steady", data["run"])
        ended = [s for s in data["series"] if "unfinished" not in s]
        # A series is reported before its worker process has ended, after which it counts as ended.
        check(len(ended) - data["run"]["ended"] in (0, 1), len(ended), data["run"])
        check(all(s["status"] == "done" and len(s["pictures"]) == 4 for s in ended), "half a series")
    b.ok(0, "sheet", "-O", folder, *words)
    data = sheet(folder)
    check("run" not in data and len(data["series"]) == n, "the last sheet")
    check(not any("unfinished" in s for s in data["series"]), "unfinished")
    # An interrupted batch shows its progress.
    run = b.start("batch", "sheet", "-O", "i", *OPTIONS)
    while not glob.glob("i/*/*.png"):
        time.sleep(0.01)
    run.send_signal(signal.SIGTERM)
    run.communicate()
    check(run.returncode in (0, 130), run.returncode)
    check(run.returncode == 0 or not sheet("i")["run"]["goes_on"], "an end that is none")


def test_progress_lines(b):
    """Progress without a terminal: a line a minute (with CTS_SOAK, since it takes one)."""
    if not os.environ.get("CTS_SOAK"):
        print("progress_lines: skipped, takes a minute; ./dev soak runs it")
        return
    archive = b.archive("progress", 3)
    run = b.start("batch", archive, "-O", "o", "--jobs", "1", *OPTIONS)
    while not glob.glob("o/*/*.png"):
        time.sleep(0.001)
    stopped = children(run.pid)
    for pid in stopped:
        os.kill(pid, signal.SIGSTOP)
    time.sleep(63)
    for pid in stopped:
        os.kill(pid, signal.SIGCONT)
    said = run.communicate()[1]
    check(run.returncode == 0 and len(re.findall(r"ctsplat: [0-9] of 3 series, [0-9]+ pictures", said)) == 1, said)


def test_circles(b):
    """Rotations from views of one elevation are joined, with a message; equal findings are listed once, with their
    count."""
    b.add("circles", 0)
    done = b.ok(0, "circles", "-O", "o", "--size", "32x32", "--rotation", "4", "--views", "anterior,left,0,30,90,30,head",
                "--window", "0,1", "--crop", "-9,9,-9,9,-9,9")
    reported = [line for line in done.stderr.split("\n") if "--rotation" in line]
    check(len(reported) == 2 and "left" in reported[0] and "anterior" in reported[0] and "90,30" in reported[1], done.stderr)
    line = b.lines("o")[b.name(0).decode()]
    check({o["view"] for o in line["outputs"]} == {"anterior", "0,30", "head"}, line["outputs"])
    check(len(line["outputs"]) == 12, len(line["outputs"]))
    texts = [(f["code"], f["text"], f.get("preset")) for f in line["findings"]]
    check(len(texts) == len(set(texts)), texts)
    b.ok(0, "circles", "-O", "p", "--size", "32x32", "--views", "anterior,left")
    check(len(b.lines("p")[b.name(0).decode()]["outputs"]) == 2, "without --rotation")
    animated = ["circles", "-O", "q", "--size", "32x32", "--rotation", "4", "--formats", "webp,png"]
    b.ok(0, *animated)
    done = b.ok(0, *animated)
    check("1 of them in earlier runs" in done.stderr, done.stderr)


def test_settled(b):
    """Series that grow wait, what nothing changes costs no reading, failures are tried again ever more rarely."""
    def run(code, *more):
        return b.ok(code, "in", "-O", "o", "--settled", "1", "--size", "32x32", "--formats", "dcm", *more).stderr

    def line(i):
        return b.lines("o")[b.name(i).decode()]

    os.mkdir("in")
    check(run(0) == "", "an empty folder is no error, and says nothing")
    b.add("in", 0)
    check("1 waiting" in run(0) and line(0)["status"] == "waiting" and not line(0)["outputs"], line(0))
    time.sleep(2.1)
    b.add("in", 1, lambda data, k: data if k < 7 else None)
    check("done: " in run(0) and line(0)["status"] == "done" and line(1)["status"] == "waiting", line(0), line(1))
    time.sleep(2.1)
    run(0)
    check(run(0) == "", "a run that has nothing to do speaks:", run(0))
    before = b.outputs("o")
    # A state that is lost, whole or in part, means a search, which comes to the same.
    for lose in (lambda: os.remove("o/.batch.idle"), lambda: open("o/.batch.idle", "w").close(),
                 lambda: os.remove("o/index.html"), lambda: os.utime("o/batch.jsonl")):
        lose()
        check("2 of 2 series done (2 of them" in run(0) and b.outputs("o") == before, "not the same")
    # The last slices come: the series waits, keeps its picture until then, and gets that of the whole series.
    shutil.rmtree("in/series1")
    b.add("in", 1)
    check("1 waiting" in run(0) and line(1)["outputs"] and b.outputs("o") == before, line(1))
    time.sleep(2.1)
    run(0)
    check(line(1)["files"] == 10 and b.outputs("o") != before, line(1))
    check(run(0, "--fresh") and run(0, "--presets", "skin"), "--fresh, and another preset, take all series")
    # A failed series is tried again after 1 s, 2 s ... 64 s, and not before; a changed one at once.
    def pause():
        again, ended = (time.mktime(time.strptime(line(0)[key], "%Y-%m-%dT%H:%M:%SZ")) for key in ("try_again", "ended"))
        return again - ended

    shutil.rmtree("o")
    os.mkdir("o")
    with open("o/" + b.name(0).decode(), "w") as f:
        f.write("no folder")
    check("is not a folder" in run(8) and line(0)["tries"] == 1 and 1 <= pause() <= 2, line(0))
    for tries, seconds in (3, 8), (6, 64), (40, 64):
        with open("o/batch.jsonl") as f:
            text = re.sub('"tries":[0-9]+', '"tries":%d' % tries, f.read())
        with open("o/batch.jsonl", "w") as f:
            f.write(re.sub('"try_again":"[^"]*"', '"try_again":"2026-01-01T00:00:00Z"', text))
        check("is not a folder" in run(8) and line(0)["tries"] == tries + 1 and seconds <= pause() <= seconds + 1, line(0))
        check("is not a folder" not in run(8) and line(0)["tries"] == tries + 1, "tried before it was due:", line(0))
    os.utime("in/series0/000.dcm")
    time.sleep(2.1)
    check("is not a folder" in run(8) and line(0)["tries"] == 1, "a changed series is not tried at once:", line(0))
    # A second run while one lasts ends with a message; killed in any phase, the next one comes to the same files.
    shutil.rmtree("o")
    run(0)
    expected = b.outputs("o")
    r = random.Random(b.args.seed)
    for i in range(b.args.kills):
        shutil.rmtree("o")
        first = b.start("batch", "in", "-O", "o", "--settled", "1", "--size", "32x32", "--formats", "dcm")
        time.sleep(r.uniform(0, 0.3))
        first.kill()
        first.communicate()
        run(0)
        check(run(0) == "" and b.outputs("o") == expected, "other files after kill", i)
    # Files that vanish, as when the receiver removes a study: its pictures stay until they are forgotten.
    shutil.rmtree("in/series0")
    check("1 of 1 series done" in run(0) and b.outputs("o") == expected, "vanished")
    run(0, "--forget", "2")
    check(b.outputs("o") == expected, "forgotten on the day")
    with open("o/batch.jsonl") as f:
        text = re.sub('"ended":"[^"]*"', '"ended":"2026-01-01T00:00:00Z"', f.read())
    with open("o/batch.jsonl", "w") as f:
        f.write(text)
    shutil.move("in/series1", "series1")
    run(0, "--forget", "2")
    check(b.outputs("o") == expected, "forgotten since the folder is empty")
    shutil.move("series1", "in/series1")
    time.sleep(2.1)
    run(0, "--forget", "2")
    left = {path: digest for path, digest in expected.items() if path.startswith(b.name(1).decode())}
    check(b.outputs("o") == left and list(b.lines("o")) == [b.name(1).decode()], "not forgotten, or more:", os.listdir("o"))
    check(not os.path.exists("o/" + b.name(0).decode()), "an empty folder is left")


def test_odd_names(b):
    """A UID from outside never leaves DIR."""
    for i, odd in enumerate((b"../../x", b"/etc/x\\y", b"..", b"1.2.3 $(x)")):
        b.add("odd", i, lambda data, k: data.replace(b.name(i), odd + b" " * (len(b.uid) - len(odd))))
    done = b.run("batch", "odd", "-O", "o", *OPTIONS)
    check(done.returncode in (0, 8), done.returncode, done.stderr)
    names = set(os.listdir("o"))
    check(all(n.startswith("uid-") or n[0] in ".bi" for n in names), names)
    check(len(b.lines("o")) == 4, list(b.lines("o")))


def hashes(b, folder):
    found = {}
    for root, _, names in os.walk(folder):
        for name in names:
            if root != folder:
                with open(os.path.join(root, name), "rb") as f:
                    found[os.path.relpath(os.path.join(root, name), folder)] = hashlib.sha256(f.read()).hexdigest()
    return found


def lines_torn(b, folder):
    """The journal of a run that was killed: only its last line may be torn."""
    found = {}
    try:
        with open(folder + "/batch.jsonl") as f:
            text = f.read().split("\n")
    except FileNotFoundError:
        return found
    for line in text[:-1]:
        line = json.loads(line)
        found[line["series_uid"]] = line
    return found


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("ctsplat", type=os.path.abspath)
    parser.add_argument("testdata", type=os.path.abspath)
    parser.add_argument("folder")
    parser.add_argument("what", nargs="*")
    parser.add_argument("--series", type=int, default=6)
    parser.add_argument("--kills", type=int, default=4)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    Batch.hashes, Batch.lines_torn = hashes, lines_torn
    for what in args.what:
        folder = os.path.join(args.folder, what)
        os.makedirs(folder)
        os.chdir(folder)
        start = time.time()
        globals()["test_" + what](Batch(args))
        print("%s: ok, %.1f s" % (what, time.time() - start), flush=True)
        shutil.rmtree(folder)


main()
