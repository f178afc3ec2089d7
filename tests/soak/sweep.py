#!/usr/bin/env python3
"""Compares an engine's error limits with the ray caster on random scenes: sweep.py CTSPLAT RAW2CT [DATA]

Random volumes (noise, plates, wires, dots, specks, a helix, balls, metal and haze, levels side by side; a series of DATA
in every fourth round, with presets of relative scale where it is not in HU), presets (hard steps, peaks between levels, ramps, built-ins), views, scales and lighting.
Every picture by --engine (auto) is compared with the one by engine raycast. Faults are: a picture whose error
exceeds the limit in its log, rms or largest; one above the requested error, 0.5/255 rms by default, without a
warning; one that is not rendered. Each is printed with the commands that
reproduce it, and its series is kept in soak-failures/. The same --seed repeats the same scenes; --only N runs
round N alone.

With --large half of the pictures are large, most of them rotations. These are rendered with one thread and with
three, whose files must be equal, and are verified by rays; where that leaves doubt, every frame is compared with
the ray caster's, and the worst is compared with the reported limit."""
import argparse
import filecmp
import glob
import json
import math
import os
import random
import shlex
import shutil
import subprocess
import sys
import tempfile
import time

import numpy as np

BUILT_IN = [
    'bone', 'skin', 'muscle', 'lung', 'vessel', 'metal', 'ct-aaa', 'ct-air', 'ct-bone', 'ct-bones', 'ct-cardiac3',
    'ct-chest-vessels', 'ct-coronary-arteries', 'ct-cropped-volume-bone', 'ct-fat', 'ct-liver-vasculature', 'ct-lung',
    'ct-mip', 'ct-muscle', 'ct-pulmonary-arteries', 'ct-soft-tissue', 'ct-x-ray',
]
TRAPS = ['dots', 'plates', 'specks', 'wires'] # errors are large in few pixels
VERIFIED = 8192 # pixels of each frame
# 16-bit pictures of both engines are rounded, each by less than this rms and by half a level at most.
ROUNDED, ROUNDED_MOST = 0.003 / 255, 1.1 / 65535


def grid(dims):
    """z, y, x of each voxel, as the raw volume lies."""
    return np.meshgrid(*(np.arange(n, dtype=float) for n in reversed(dims)), indexing='ij')


def thin(r, rng, dims, kinds):
    z, y, x = grid(dims)
    step, at = r.choice([4, 5, 6, 8, 11]), 2
    hu = np.full(z.shape, r.choice([-1000.0, 0, 40]))
    axes = r.sample([z, y, x], 3)
    mask = axes[0] % step == at
    for axis in axes[1:kinds]:
        mask &= axis % step == at
    hu[mask] = r.choice([300, 1500, 2500, 12000, 20000])
    return hu


def specks(r, rng, dims):
    hu = np.full(tuple(reversed(dims)), r.choice([-1000.0, 0, 40]))
    for _ in range(r.choice([1, 5, 40, 200])):
        hu[tuple(r.randrange(n) for n in hu.shape)] = r.choice([300, 1500, 2500, 20000])
    return hu


def helix(r, rng, dims):
    z, y, x = grid(dims)
    x, y = x - dims[0] / 2, y - dims[1] / 2
    pitch, radius = r.choice([5, 8]), 0.3 * min(dims[:2])
    off = np.abs((z - pitch * np.arctan2(y, x) / (2 * math.pi) + pitch / 2) % pitch - pitch / 2)
    return np.where((np.abs(np.hypot(x, y) - radius) < 0.6) & (off < 0.7), r.choice([2500, 20000]), 40.0)


def balls(r, rng, dims):
    z, y, x = grid(dims)
    hu = np.full(z.shape, -1000.0)
    for _ in range(r.choice([1, 3, 12])):
        c = [r.uniform(0, n) for n in dims]
        d = np.sqrt((x - c[0]) ** 2 + (y - c[1]) ** 2 + (z - c[2]) ** 2)
        size, edge = r.uniform(1, 0.4 * min(dims)), r.choice([0.3, 1, 4])
        hu = np.maximum(hu, -1000 + r.choice([1040, 1300, 2000, 4000]) * np.clip((size - d) / edge + 0.5, 0, 1))
    return hu + rng.normal(0, r.choice([0, 0, 15]), hu.shape)


def waves(r, rng, dims):
    z, y, x = grid(dims)
    k = [r.uniform(0.05, 1.2) for _ in range(3)]
    return 300 + r.choice([200, 1000]) * np.sin(k[0] * x) * np.cos(k[1] * y + 0.3) * np.cos(k[2] * z)


def haze(r, rng, dims):
    z, y, x = grid(dims)
    hu = 40 + rng.uniform(-20, 20, z.shape)
    hu[r.choice([x, y, z]) > 0.7 * min(dims)] = r.choice([3000, 20000])
    return hu


VOLUMES = {
    'noise': lambda r, rng, d: rng.normal(r.choice([0, 300]), r.choice([30, 300, 1500]), tuple(reversed(d))),
    'plates': lambda r, rng, d: thin(r, rng, d, 1),
    'wires': lambda r, rng, d: thin(r, rng, d, 2),
    'dots': lambda r, rng, d: thin(r, rng, d, 3),
    'specks': specks,
    'helix': helix,
    'balls': balls,
    'waves': waves,
    'haze': haze,
    'levels': lambda r, rng, d: 500.0 + rng.integers(0, 2, tuple(reversed(d))),
}


def make_volume(r, kind, raw2ct, folder, most):
    """Writes a series of at most so many voxels each way; its HU's range and how far apart voxels lie."""
    dims = [r.randint(12, most) for _ in range(3)]
    spacing = r.choice([[1, 1, 1], [0.5, 0.5, 0.5], [0.7, 0.7, 1], [1, 1, 3], [0.9, 0.9, 0.3]])
    hu = VOLUMES[kind](r, np.random.default_rng(r.getrandbits(32)), dims)
    hu = np.clip(np.rint(hu), -1024, 30000).astype('<i2')
    raw = os.path.join(folder, 'raw')
    hu.tofile(raw)
    subprocess.run([raw2ct, '--size', ','.join(map(str, dims)), '--spacing', ','.join(map(str, spacing)), raw,
                    os.path.join(folder, 'series')], check=True, stdout=subprocess.DEVNULL)
    os.remove(raw)
    return float(hu.min()), float(hu.max()), min(spacing), max(n * s for n, s in zip(dims, spacing))


def rgb(r):
    return [round(r.random(), 2) for _ in range(3)]


def make_preset(r, low, high, path, smooth, is_hu=True):
    """A preset for HU from low to high, or a relative one, for which they stand for air and bright tissue; its kind."""
    kind = r.choice(['ramp', 'peaks'] if smooth else ['step', 'step', 'shell', 'ramp', 'peaks', 'stripes', 'between'])
    # Products of fractions of a voxel that rays take, such as 0.05 x 0.2, would put a step on the value of a whole ray.
    near = r.choice([0.00137, 0.0131, 0.9869, 0.99863])
    at = low + (high - low) * (r.uniform(0.05, 0.95) if r.random() < 0.7 else near)
    a = r.choice([1, 0.9, 0.5, 0.1, 0.01])
    if kind == 'step':
        points = [(at, 0, rgb(r)), (at, a, rgb(r)), (high + 1, a, rgb(r))]
    elif kind == 'shell':
        points = [(at, 0, rgb(r)), (at, a, rgb(r)), (at + r.choice([5, 0.02, 0.5]) * (high - at), a, rgb(r))]
        points += [(points[-1][0], 0, points[-1][2])]
    elif kind == 'ramp':
        points = [(at, 0, rgb(r)), (at + r.choice([150, 300] if smooth else [1, 30, 300]), a, rgb(r))]
    elif kind == 'between':
        level = math.floor(at)
        points = [(level + 0.02, 0, rgb(r)), (level + 0.5, 1, rgb(r)), (level + 0.98, 0, rgb(r))]
    elif kind == 'peaks':
        width, points = r.choice([200] if smooth else [2, 20, 200]), []
        for k in range(r.randint(1, 4)):
            c = at + 3 * k * width
            colour = rgb(r)
            points += [(c - width / 2, 0, colour), (c, a, colour), (c + width / 2, 0, colour)]
    else:
        n, points = r.randint(2, 8), []
        for k in range(n):
            hu, colour, b = low + (high - low) * (k + r.random()) / n, rgb(r), r.choice([0, 0.02, 0.3, 1])
            points += [(hu, points[-1][1] if points else 0, points[-1][2] if points else colour), (hu, b, colour)]
    shade = None
    if r.random() < 0.4:
        shade = {'occlusion': r.choice([0, round(r.random(), 2), 1]),
                 'ambient': round(r.random(), 2), 'diffuse': round(r.random(), 2),
                 'specular': r.choice([0, 0.2, 0.8]), 'power': r.choice([1, 10, 100, 1000])}
    scale = {} if is_hu else {'scale': 'relative'}
    key, step = ('hu', 1) if is_hu else ('at', 1 / (high - low))
    with open(path, 'w') as f:
        json.dump({'name': kind, 'shade': shade, 'remove_table': False, **scale,
                   'points': [{key: h if is_hu else step * (h - low), 'opacity': o, 'rgb': c} for h, o, c in points]}, f)
    return kind + (' lit' if shade else '')


def make_view(r):
    if r.random() < 0.2:
        return '%g,%g' % (r.choice([0, 90, 180, 270]), r.choice([0, 0, 0, 90, -90]))
    if r.random() < 0.2:
        return '%.3f,%.3f' % (r.choice([0, 45, 90]) + r.gauss(0, 2), r.gauss(0, 2))
    if r.random() < 0.2: # layers lie along the picture's rows
        return '%g,%.2f' % (r.choice([0, 90, 180, 10]), r.uniform(-89, 89))
    return '%.2f,%.2f' % (r.uniform(-180, 180), math.degrees(math.asin(r.uniform(-1, 1))))


def read_log(path):
    """The reported limit, the verified error, and the message for a limit above the requested error, if any."""
    with open(path) as f:
        events = [json.loads(line) for line in f]
    last = {e['event']: e for e in events}
    said = [e['severity'] for e in events if e['event'] == 'finding' and e['code'] == 'error_bound']
    return last.get('bound'), last.get('error'), said[-1] if said else None


class Sweep:
    def __init__(self, args):
        self.args = args
        self.ratios, self.errors, self.faults, self.pictures, self.series = [], [], 0, 0, []
        self.kinds = dict.fromkeys(['kept', 'warned', 'false positive', 'silent'], 0)
        self.compared, self.by = 0, {}
        self.modality = {}
        for root, _, files in os.walk(args.data or os.devnull):
            if sum(name != 'DIRFILE' for name in files) >= 20:
                self.series.append(root)
                self.modality[root] = json.loads(self.run('info', root, '--json').stdout)['series'][0]['modality']
        self.series.sort()

    def run(self, *words):
        return subprocess.run([os.path.abspath(self.args.ctsplat), *words], stdin=subprocess.DEVNULL,
                              capture_output=True, text=True, timeout=1200)

    def held(self, bound, said, rms, most, asked, what, frames=1):
        """A description of the fault, or None: an error compared with its reported limit. Counts kinds of pictures."""
        limit = (asked or 0.5) / 255
        if not bound:
            return 'no bound in the log'
        by = ' '.join(filter(None, [bound['engine'], bound.get('level')]))
        self.by[by] = self.by.get(by, 0) + frames
        if rms > 1e-4 / 255 and bound['rmse'] > 0:
            self.ratios.append((bound['rmse'] / max(rms, ROUNDED), what))
        self.errors.append((rms, what, asked))
        largest = 1 if bound['max'] is None else bound['max']
        says = '%.3f/255 rms, reported %.3f; largest %.2f/255, reported %.2f; requested %s' % (
            255 * rms, 255 * bound['rmse'], 255 * most, 255 * largest, asked or 'nothing')
        faults = []
        if rms > bound['rmse'] + ROUNDED:
            faults.append('above its bound')
        if most > largest + ROUNDED_MOST:
            faults.append('a pixel above the reported largest error')
        if rms > limit + ROUNDED and said != 'warning':
            faults.append('above %g/255 without a warning' % (asked or 0.5))
        vain = rms <= limit and said == 'warning'
        kind = 'false positive' if vain else 'warned' if said == 'warning' else 'kept'
        self.kinds['silent' if faults else kind] += frames
        if rms < 0.25 * limit and vain and self.args.cautious:
            faults.append('false positive')
        return '; '.join(faults) + ': ' + says if faults else None

    def check(self, folder, common, asked, what):
        """None or a fault's words."""
        log, mine, exact = (os.path.join(folder, n) for n in ('log', 'picture.png', 'raycast.png'))
        if os.path.exists(log):
            os.remove(log)
        one = common + ['--engine', self.args.engine] + (['--max-error', '%g' % asked] if asked else []) + [
            '-o', mine, '--force', '--log', log]
        two = common + ['--engine', 'raycast', '-o', exact, '--force']
        for words in (one, two):
            done = self.run(*words)
            if done.returncode:
                return 'exit %d: %s' % (done.returncode, done.stderr.strip()), [words]
        found = json.loads(self.run('compare', mine, exact, '--json').stdout)
        bound, _, said = read_log(log)
        self.pictures += 1
        return (self.held(bound, said, found['rmse'], found['max'], asked, what),
                [one, two, ['compare', mine, exact]])

    def judge_large(self, folder, common, asked, what, depth):
        """The same of a large one: of each frame, and of all that threads make."""
        for name in glob.glob(os.path.join(folder, 'large*')):
            os.remove(name)
        log, exact, frames = os.path.join(folder, 'large-log'), os.path.join(folder, 'large-exact.png'), []
        commands = []
        for threads in (1, 3):
            made = [os.path.join(folder, 'large-%d.%s' % (threads, form)) for form in ['png'] + ['exr'] * depth]
            commands.append(common + ['--engine', self.args.engine, '--max-error', '%g' % asked, '--threads', '%d' % threads, '--force'] +
                            [word for path in made for word in ('-o', path)])
        commands[0] += ['--verify', '%d' % VERIFIED, '--log', log]
        for words in commands:
            done = self.run(*words)
            if done.returncode:
                return 'exit %d: %s' % (done.returncode, done.stderr.strip()), [words]
        frames = sorted(glob.glob(os.path.join(folder, 'large-1*.png')))
        bound, verified, said = read_log(log)
        self.pictures += len(frames)
        for path in glob.glob(os.path.join(folder, 'large-1*')):
            if not filecmp.cmp(path, path.replace('large-1', 'large-3'), shallow=False):
                return '%s differs by threads' % os.path.basename(path), commands
        # One frame may have all of the error that is reported for them together.
        worst = verified['rmse'] * math.sqrt(len(frames))
        if not bound or worst < 0.5 * bound['rmse']:
            return (self.held(bound, said, verified['rmse_low'], verified['max'], asked, what, len(frames)),
                    commands)
        words = common + ['--engine', 'raycast', '-o', exact, '--force']
        done = self.run(*words)
        if done.returncode:
            return 'exit %d: %s' % (done.returncode, done.stderr.strip()), [words]
        self.compared += len(frames)
        commands.append(words)
        found = []
        for frame in frames:
            commands.append(['compare', frame, frame.replace('large-1', 'large-exact')])
            found.append(json.loads(self.run(*commands[-1], '--json').stdout))
        return (self.held(bound, said, max(f['rmse'] for f in found), max(f['max'] for f in found), asked, what,
                          len(frames)), commands)

    def round(self, number):
        r = random.Random(self.args.seed * 1000003 + number)
        large = self.args.large and r.random() < 0.5
        with tempfile.TemporaryDirectory() as folder:
            if self.series and r.random() < self.args.real:
                source = r.choice(self.series)
                kind = self.modality[source].lower()
                low, high, pitch, side = -1000, 1500, 0.8, 300
            else:
                kind = r.choice(TRAPS if self.args.traps else sorted(VOLUMES))
                low, high, pitch, side = make_volume(r, kind, self.args.raw2ct, folder, 120 if large else 44)
                source = os.path.join(folder, 'series')
            is_real, is_hu = kind in ('ct', 'mr', 'pt'), kind not in ('mr', 'pt')
            for n in range(2 if is_real else 4):
                preset = r.choice(BUILT_IN if is_hu else ['mr']) if r.random() < (0.7 if kind == 'ct' else 0.2) else None
                preset = None if kind == 'pt' else preset
                path = os.path.join(folder, 'preset-%d.json' % n)
                name = preset or make_preset(r, low, high, path, self.args.smooth, is_hu)
                asked = r.choice([None, None, None, 8, 2, 1, 0.5, 0.25, 0.1])
                if self.args.smooth:
                    asked = r.choice([1, 2, 4, 8])
                if self.args.large:
                    asked = r.choice([1, 2, 3, 5, 8, 12])
                if large:
                    asked = r.choice([5, 8, 12, 20])
                    width, height = r.randint(362, 520), r.randint(362, 440)
                    fits = side / min(width, height)
                    mm = min(0.1 * pitch * (12 * fits / pitch) ** r.random(), 1.2 * fits)
                elif self.args.traps:
                    mm = pitch * 0.05 * 20 ** r.random()
                    width, height = r.randint(150, 400), r.randint(150, 400)
                else:
                    mm = pitch * r.choice([0.1, 0.25, 0.5, 1, 2, 4]) if not is_real else r.choice([0.4, 1, 2])
                    width = min(max(int(side / mm * r.uniform(0.3, 1.4)), 20), 160)
                    height = max(16, int(width * r.uniform(0.5, 1.2)))
                common = ['render', source, '-p', preset or path, '--view', make_view(r), '--mm-per-pixel', '%g' % mm,
                          '--fit', 'volume', '--size', '%dx%d' % (width, height), '--remove-table', 'off']
                if large and r.random() < 0.8:
                    common += ['--rotation', '%d' % r.randint(2, 4)]
                if preset and r.random() < 0.3:
                    common += ['--shade', 'off']
                if r.random() < 0.1:
                    common += ['--opacity-unit', 'voxel']
                if r.random() < 0.1:
                    common += ['--slab', '%.2f' % (side * r.uniform(0.02, 0.5))]
                if r.random() < 0.1:
                    common += ['--background', '#%06x' % r.getrandbits(24)]
                what = '%s%s by %s' % ('large ' if large else '', kind, name)
                if large:
                    fault, commands = self.judge_large(folder, common, asked, what, r.random() < 0.2)
                else:
                    if self.args.threads:
                        common += ['--threads', '%d' % self.args.threads]
                    fault, commands = self.check(folder, common, asked, what)
                if fault:
                    self.keep(folder, '%d-%d-%d' % (self.args.seed, number, n), what, fault, commands)

    def keep(self, folder, name, what, fault, commands):
        kept = os.path.abspath(os.path.join(self.args.failures, 'sweep-' + name))
        self.faults += 1
        shutil.rmtree(kept, ignore_errors=True)
        shutil.copytree(folder, kept)
        print('FAULT %s: %s: %s' % (name, what, fault))
        for words in commands:
            print('  ' + shlex.join([self.args.ctsplat] + [w.replace(folder, kept) for w in words]))
        sys.stdout.flush()

    def print_summary(self, rounds):
        ratios = sorted(ratio for ratio, _ in self.ratios)
        if ratios:
            print('bound over error: %.2g at least, median %.3g, 95 %% below %.3g' % (
                ratios[0], ratios[len(ratios) // 2], ratios[len(ratios) * 95 // 100]))
        for rms, what, asked in sorted(self.errors, reverse=True, key=lambda e: e[0])[:10]:
            print('%8.3f/255 rms, asked %s: %s' % (255 * rms, asked or 'nothing', what))
        if self.compared:
            print('of the large ones %d compared pixel by pixel' % self.compared)
        print('rendered by: ' + ', '.join('%s %d' % pair for pair in sorted(self.by.items())))
        print('sweep: %d rounds, %d pictures (%s), %d faults' % (
            rounds, self.pictures, ', '.join('%d %s' % (n, kind) for kind, n in self.kinds.items()), self.faults))


def main():
    p = argparse.ArgumentParser(description=__doc__)
    p.add_argument('ctsplat')
    p.add_argument('raw2ct')
    p.add_argument('data', nargs='?', help='a folder of CT series')
    p.add_argument('--minutes', type=float, default=10)
    p.add_argument('--rounds', type=int, default=0, help='stop after so many rounds')
    p.add_argument('--only', type=int, default=0)
    p.add_argument('--seed', type=int, default=1)
    p.add_argument('--real', type=float, default=0.25, help='share of the rounds on DATA')
    p.add_argument('--engine', help='default: auto; with --smooth sheets, since auto marches small pictures')
    p.add_argument('--smooth', action='store_true', help='no preset with a step; errors asked for are 1/255 to 8/255')
    p.add_argument('--threads', type=int, default=0)
    p.add_argument('--failures', default='soak-failures')
    p.add_argument('--large', action='store_true', help='errors asked for are all 1/255 or more')
    p.add_argument('--traps', action='store_true', help='specks, wires and plates alone, at 0.05 to 1 voxel a pixel')
    p.add_argument('--cautious', action='store_true', help='a warning of an error four times too large is a fault too')
    args = p.parse_args()
    args.engine = args.engine or ('sheets' if args.smooth else 'auto')
    sweep, rounds, end = Sweep(args), 0, time.monotonic() + 60 * args.minutes
    while time.monotonic() < end and (not args.rounds or rounds < args.rounds):
        rounds += 1
        sweep.round(args.only or rounds)
        if args.only:
            break
    sweep.print_summary(rounds)
    sys.exit(1 if sweep.faults or not sweep.pictures else 0)


main()
