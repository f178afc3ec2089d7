#!/usr/bin/env python3
"""Damages copies of the test series and of a preset at random and renders them: mutate.py CTSPLAT TESTDATA

A picture, or one error line with exit 3 or 4 (2 for a preset), are the only right answers; a crash, a sanitizer's
report, a hang, a second error line or a file left behind are faults. What caused one is kept in soak-failures/, with
the command. With --many N a process reads N damaged series, each with a UID of its own, and describes them: ten times
as many rounds, without the renders. Best run on a build with sanitizers. The same --seed repeats the same damage."""
import argparse
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time

PRESET = '''{ "name": "soak", "window": [0, 2000], "mode": "composite", "unit_distance_mm": 1,
  "points": [ {"hu": 150, "rgb": [0.9, 0.6, 0.4], "opacity": 0.0}, {"hu": 900, "rgb": [1, 1, 1], "opacity": 0.7} ],
  "shade": {"ambient": 0.2, "diffuse": 0.8, "specular": 0.3, "power": 20}, "background": "#102030" }
'''
LENGTHS = [b'\xff\xff\xff\xff', b'\x00\x00\x00\x00', b'\xfe\xff\xff\x7f', b'\xff\xff', b'\x01\x00', b'\x00\x00\x00\x80']
NUMBERS = [b'0', b'-1', b'nan', b'inf', b'1e400', b'65535', b'0,5', b'99999999999', b'\\\\', b' ']


def damage(data, r):
    """One random fault. Most strike the header, where the meaning is."""
    data = bytearray(data)
    at = r.randrange(max(1, min(len(data), r.choice([len(data), 1500]))))
    n = r.choice([1, 2, 4, 16, 64, 500])
    kind = r.randrange(8)
    if kind == 0:
        data[at:at + 1] = bytes([data[at] ^ (1 << r.randrange(8))]) if data else b''
    elif kind == 1:
        del data[at:]
    elif kind == 2:
        del data[at:at + n]
    elif kind == 3:
        data[at:at] = bytes(r.randrange(256) for _ in range(n))
    elif kind == 4:
        data[at:at] = data[at:at + n]
    elif kind == 5:
        new = r.choice(LENGTHS)
        data[at:at + len(new)] = new
    elif kind == 6:
        new = r.choice(NUMBERS)
        digits = [i for i, c in enumerate(data[:1500]) if 48 <= c <= 57]
        at = r.choice(digits) if digits else at
        data[at:at + len(new)] = new
    else:
        data[at:at + n] = bytes(r.choice([0, 255]) for _ in range(n))
    return bytes(data)


def rename_series(folder, number):
    """A UID of its own for the series, of the same length; a deflated one keeps its own."""
    for name in os.listdir(folder):
        with open(os.path.join(folder, name), 'r+b') as f:
            data = f.read()
            tag = max(data.find(b'\x20\x00\x0e\x00UI'), data.find(b'\x00\x20\x00\x0eUI'))
            end = tag + 8 + max(data[tag + 6:tag + 8], default=0)
            digits = b'%06d' % number
            if tag >= 0 and data[end - 7:end - 1].isdigit():
                f.seek(end - 7)
                f.write(digits)


def damage_series(source, target, r, number=None):
    shutil.copytree(source, target)
    if number is not None:
        rename_series(target, number)
    names = sorted(os.listdir(target))
    for name in r.sample(names, min(len(names), r.choice([1, 1, 2, 8]))):
        path = os.path.join(target, name)
        with open(path, 'rb') as f:
            data = f.read()
        for _ in range(r.choice([1, 1, 1, 3])):
            data = damage(data, r)
        with open(path, 'wb') as f:
            f.write(data)


def run(command, folder, codes):
    """None, or what is wrong."""
    if command[1] == 'render':
        command = command + ['-o', os.path.join(folder, 'out.png')]
    try:
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, timeout=120)
    except subprocess.TimeoutExpired:
        return 'hangs'
    said = done.stderr.decode('utf-8', 'replace')
    errors = sum(line.startswith('ctsplat: error: ') for line in said.splitlines())
    if 'Sanitizer' in said or 'runtime error' in said:
        return 'sanitizer: ' + said
    if done.returncode not in codes:
        return 'exit %d: %s' % (done.returncode, said)
    if errors != (done.returncode != 0):
        return '%d error lines with exit %d: %s' % (errors, done.returncode, said)
    left = [n for n in os.listdir(folder) if n not in ('series', 'preset.json')]
    if left != ([] if done.returncode or command[1] != 'render' else ['out.png']):
        return 'exit %d leaves %s' % (done.returncode, left)
    return None


def main():
    p = argparse.ArgumentParser(description=__doc__)
    p.add_argument('ctsplat')
    p.add_argument('testdata')
    p.add_argument('--minutes', type=float, default=10)
    p.add_argument('--rounds', type=int, default=0, help='stop after so many rounds')
    p.add_argument('--seed', type=int, default=1)
    p.add_argument('--many', type=int, default=1, help='series a process')
    args = p.parse_args()
    os.environ.setdefault('ASAN_OPTIONS', 'allocator_may_return_null=1:max_allocation_size_mb=2000')
    series = sorted(root for root, _, files in os.walk(args.testdata) if 1 < len(files) < 20)
    end = time.monotonic() + 60 * args.minutes
    rounds = faults = pictures = 0
    while time.monotonic() < end and (not args.rounds or rounds < args.rounds):
        r = random.Random(args.seed * 1000003 + rounds)
        rounds += 1
        with tempfile.TemporaryDirectory() as folder:
            command = [os.path.abspath(args.ctsplat), 'render', os.path.join(folder, 'series'), '--size', '24x20']
            if args.many > 1:
                rounds += args.many - 1
                command = [os.path.abspath(args.ctsplat), 'info', os.path.join(folder, 'series')]
                for i in range(args.many):
                    damage_series(r.choice(series), os.path.join(folder, 'series', str(i)), r, i)
                fault = run(command, folder, (0, 3, 4))
            elif rounds % 5:
                damage_series(r.choice(series), os.path.join(folder, 'series'), r)
                fault = run(command, folder, (0, 3, 4))
            else:
                shutil.copytree(os.path.join(args.testdata, 'syntax', 'explicit'), os.path.join(folder, 'series'))
                with open(os.path.join(folder, 'preset.json'), 'wb') as f:
                    f.write(damage(PRESET.encode(), r))
                command += ['-p', os.path.join(folder, 'preset.json')]
                fault = run(command, folder, (0, 2))
            pictures += os.path.exists(os.path.join(folder, 'out.png'))
            if fault:
                faults += 1
                kept = os.path.join('soak-failures', '%d-%d' % (args.seed, rounds))
                shutil.rmtree(kept, ignore_errors=True)
                shutil.copytree(folder, kept)
                print('%s: %s\n%s' % (kept, ' '.join(command), fault), flush=True)
    print('soak: %d rounds, %d pictures, %d faults' % (rounds, pictures, faults))
    sys.exit(1 if faults or not (pictures or args.many > 1) else 0)


main()
