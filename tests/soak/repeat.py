#!/usr/bin/env python3
"""Same input, same files: repeat.py CTSPLAT TESTDATA [--pictures 20000]

Renders small pictures again and again, each in a process of its own (so at other addresses) on 1 to 8 threads, with two
processes more at once than there are cores. Each file is compared with the first of its kind, made on one thread. What
differs is kept in soak-failures/repeat/; files whose pixels differ, by the PNG of the same run, are counted apart from those
whose bytes alone do."""
import argparse
import concurrent.futures
import filecmp
import os
import random
import shutil
import subprocess
import tempfile

QUICK = [
    ('bone', ['-p', 'bone', '--shade', 'on', '-o', 'a.png', '-o', 'a.exr']),
    ('skin-8', ['-p', 'skin', '--png-bits', '8', '--background', 'none', '-o', 'a.png', '-o', 'a.webp']),
    ('lung', ['-p', 'lung', '--max-error', '8', '-o', 'a.png', '-o', 'a.jpg']),
    ('mip', ['--mode', 'mip', '-o', 'a.png']),
    ('average', ['-p', 'soft', '-o', 'a.png']),
    ('classic', ['-p', 'muscle', '--engine', 'classic', '-o', 'a.png']),
    ('raycast', ['-p', 'bone', '--engine', 'raycast', '-o', 'a.png']),
]
# Captures take three times as long, for DCMTK is loaded: one in fifteen.
KINDS = 2 * QUICK + [('capture', ['-p', 'bone', '-o', 'a.png', '-o', 'a.dcm', '--compress', 'jpeg-lossless'])]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('ctsplat')
    parser.add_argument('testdata')
    parser.add_argument('--pictures', type=int, default=20000)
    parser.add_argument('--size', default='24x70')  # two strips, two bands
    arguments = parser.parse_args()
    ctsplat = os.path.abspath(arguments.ctsplat)
    series = os.path.join(os.path.abspath(arguments.testdata), 'phantom')
    environment = dict(os.environ, SOURCE_DATE_EPOCH='0')
    kept = os.path.abspath('soak-failures/repeat')

    def render(options, threads, folder):
        os.makedirs(folder)
        command = [ctsplat, 'render', series, '--view', '30,20', '--size', arguments.size, '--threads', str(threads)]
        done = subprocess.run(command + options, cwd=folder, env=environment, stdin=subprocess.DEVNULL,
                              stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        if done.returncode:
            raise SystemExit('%s: exit code %d, expected 0: %s' % (' '.join(command + options), done.returncode, done.stderr))

    n_files = n_pixels = n_bytes = 0
    with tempfile.TemporaryDirectory() as work, \
            concurrent.futures.ThreadPoolExecutor((os.cpu_count() or 1) + 2) as pool:
        for name, options in dict((k[0], k) for k in KINDS).values():
            render(options, 1, os.path.join(work, name))

        def one(i):
            """The files, those of other pixels and those of other bytes alone of picture i."""
            name, options = KINDS[i % len(KINDS)]
            threads, folder, first = random.Random(i).randint(1, 8), os.path.join(work, str(i)), os.path.join(work, name)
            render(options, threads, folder)
            files = sorted(os.listdir(first))
            other = [f for f in files if not filecmp.cmp(os.path.join(first, f), os.path.join(folder, f), shallow=False)]
            pixels = bool(other) and subprocess.run(
                [ctsplat, 'compare', os.path.join(first, 'a.png'), os.path.join(folder, 'a.png')],
                stdout=subprocess.DEVNULL).returncode != 0
            if other:
                print('picture %d (%s, %d threads): other %s in %s' % (i, name, threads, 'pixels' if pixels else 'bytes',
                                                                        ', '.join(other)), flush=True)
                os.makedirs(kept, exist_ok=True)
                shutil.copytree(first, os.path.join(kept, '%d-expected' % i), dirs_exist_ok=True)
                shutil.copytree(folder, os.path.join(kept, '%d-actual' % i), dirs_exist_ok=True)
            shutil.rmtree(folder)
            return len(files), len(other) if pixels else 0, 0 if pixels else len(other)

        for files, pixels, other in pool.map(one, range(arguments.pictures)):
            n_files, n_pixels, n_bytes = n_files + files, n_pixels + pixels, n_bytes + other
    print('%d pictures, %d files: %d of other pixels, %d of other bytes alone' % (arguments.pictures, n_files, n_pixels,
                                                                                  n_bytes))
    raise SystemExit(1 if n_pixels or n_bytes else 0)


if __name__ == '__main__':
    main()
