#!/usr/bin/env python3
"""A node that gets studies, echoes and noise for a long time, renders and sends them, and forgets what is old: its
memory, processes, descriptors and files stay as they are. node.py CTSPLAT LOOPBACK_LIBRARY SOURCE_ROOT --minutes N"""
import argparse
import glob
import os
import random
import shutil
import socket
import statistics
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', 'net'))
import peers  # noqa: E402

ROUND_S, KEPT = 4, 12  # a study so often; so many are young


def status_kib(pid):
    try:
        with open('/proc/%d/status' % pid) as f:
            return next(int(line.split()[1]) for line in f if line.startswith('VmRSS'))
    except (OSError, StopIteration):
        return 0


def below(pid):
    """The process and all that it has started."""
    found = [pid]
    for p in found:
        try:
            for thread in os.listdir('/proc/%d/task' % p):
                with open('/proc/%d/task/%s/children' % (p, thread)) as f:
                    found += [int(word) for word in f.read().split()]
        except OSError:
            pass
    return found


def is_receiver(pid):
    try:
        with open('/proc/%d/cmdline' % pid, 'rb') as f:
            return b'\0receive\0' in f.read()
    except OSError:
        return False


class Soak:
    def __init__(self, args):
        self.root, self.chance, self.n_sent, self.samples = args.root, random.Random(1), 0, []
        os.mkdir('bin')
        os.symlink(args.ctsplat, 'bin/ctsplat')
        shutil.copy(args.root + '/src/app/deploy/ctsplat-node', 'bin/')
        self.pacs = peers.Storescp('archive', args.loopback)
        self.port = peers.free_port()
        settings = {'DIR': os.getcwd() + '/node', 'LISTEN': '127.0.0.1:%d' % self.port, 'QUIET': '2', 'FREE': '0',
                    'PACS': 'ARCHIVE@127.0.0.1:%d' % self.pacs.port, 'RECEIVE': '--peer-timeout 1 --per-minute 100000',
                    'OPTIONS': '--presets bone --formats dcm --size 64x64 --threads 1'}
        with open('node.conf', 'w') as f:
            f.writelines('CTSPLAT_NODE_%s=%s\n' % item for item in settings.items())
        os.mkdir('tmp')
        self.node = subprocess.Popen(['bash', 'bin/ctsplat-node', 'node.conf'], stderr=open('node.log', 'w'),
                                     env=dict(os.environ, PATH=os.getcwd() + '/bin:' + os.environ['PATH'],
                                              TMPDIR=os.getcwd() + '/tmp', OMP_WAIT_POLICY='PASSIVE'))
        peers.wait_for_port(self.port, self.node)

    def send(self):
        """One more study, of UIDs of its own."""
        self.n_sent += 1
        shutil.rmtree('study', ignore_errors=True)
        shutil.copytree(self.root + '/testdata/geometry/feet-first', 'study')
        uid = '1.2.826.0.1.%d' % self.n_sent
        subprocess.run(['dcmodify', '-q', '-nb', '-gin', '-m', '(0020,000D)=' + uid, '-m', '(0020,000E)=%s.1' % uid] +
                       glob.glob('study/*'), check=True)
        subprocess.run(['storescu', '-aec', 'CTSPLAT', '127.0.0.1', str(self.port)] + glob.glob('study/*'), check=True,
                       stdout=subprocess.DEVNULL)

    def annoy(self):
        for _ in range(8):
            with socket.create_connection(('127.0.0.1', self.port), 60) as s:
                s.sendall(self.chance.randbytes(self.chance.randrange(1, 300)))

    def age(self):
        """A finished study that is no longer among the youngest is old."""
        for state in glob.glob('node/state/ST_*'):
            if int(state.split('.')[-1]) <= self.n_sent - KEPT:
                for path in state, state.replace('/state/', '/in/'):
                    os.utime(path, (time.time() - 9 * 86400,) * 2)

    def sample(self):
        pids = below(self.node.pid)
        lasting = [self.node.pid] + [p for p in pids if is_receiver(p)][:1]
        self.samples.append({
            'KiB': sum(map(status_kib, lasting)), 'processes': len(pids),
            'descriptors': sum(len(os.listdir('/proc/%d/fd' % p)) for p in lasting if os.path.exists('/proc/%d' % p)),
            'files': sum(len(files) for _, _, files in os.walk('node')) + len(os.listdir('tmp'))})

    def run(self, minutes):
        end = time.monotonic() + 60 * minutes
        while time.monotonic() < end:
            start = time.monotonic()
            self.send()
            self.annoy()
            self.age()
            if self.n_sent % 50 == 0: # as a rotation of logs does
                os.replace('node/received.jsonl', 'received.old')
            assert self.node.poll() is None, 'the node ended'
            while time.monotonic() < start + ROUND_S:
                self.sample()
                time.sleep(0.5)

    def finish(self):
        end = time.monotonic() + 600
        while self.pacs.count() < self.n_sent:
            assert time.monotonic() < end, '%d of %d studies came back' % (self.pacs.count(), self.n_sent)
            time.sleep(1)
        self.node.terminate()
        assert self.node.wait(60) == 0 and not os.listdir('tmp')
        assert self.pacs.count() == self.n_sent, 'more came back than was sent'
        with open('node.log') as f:
            assert 'starts again' not in f.read(), 'the receiver died'
        n, flat = len(self.samples), True
        for name, more in (('KiB', 1024), ('processes', 2), ('descriptors', 2), ('files', 40)):
            # Permanent files exist at every moment, and the number of temporary ones has a constant mean.
            early, late = ([s[name] for s in self.samples[i * n // 4:(i + 1) * n // 4]] for i in (1, 3))
            row = [min(early), min(late), statistics.median(early), statistics.median(late), max(early), max(late)]
            good = row[1] <= row[0] + more and row[3] <= 1.1 * row[2] + more
            flat &= good
            print('%-12s least %6d, then %6d; middle %8.1f, then %8.1f; most %6d, then %6d%s' %
                  (name, *row, '' if good else '  <- grows'))
        assert flat
        print('%d studies, %d samples: flat' % (self.n_sent, n))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument('ctsplat', type=os.path.abspath)
    parser.add_argument('loopback', type=os.path.abspath)
    parser.add_argument('root', type=os.path.abspath)
    parser.add_argument('--minutes', type=float, default=60)
    args = parser.parse_args()
    peers.need('storescp', 'storescu', 'dcmodify')
    with tempfile.TemporaryDirectory() as work:
        os.chdir(work)
        soak = Soak(args)
        try:
            soak.run(args.minutes)
            soak.finish()
        finally:
            for pid in below(soak.node.pid):
                try:
                    os.kill(pid, 9)
                except OSError:
                    pass
            soak.pacs.end()
            os.chdir('/')


main()
