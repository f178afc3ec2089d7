"""`ctsplat receive`: takes CT bit by bit from whom it should, and nothing from anybody else; what hostile peers do costs
them their association and the receiver nothing. With CTS_SOAK set ten thousand of them."""
import atexit
import glob
import json
import os
import random
import signal
import socket
import struct
import subprocess
import sys
import time

import peers
from dimse import Association, command, data_set, request, uid_of

ctsplat, loopback, data = os.path.abspath(sys.argv[1]), sys.argv[2], sys.argv[3]
peers.need('storescu', 'echoscu', 'openssl', 'dcmcjpeg')
SLICES = sorted(glob.glob(data + '/*.dcm'))
CT, EXPLICIT = '1.2.840.10008.5.1.4.1.1.2', '1.2.840.10008.1.2.1'


class Receiver:
    def __init__(self, folder, *words, host='127.0.0.1', env=None):
        self.folder, self.host = folder, host
        here = '[%s]' % host if ':' in host else host
        # A sanitizer takes the place of the limit on memory; what is free, it marks page by page.
        limit = {'ASAN_OPTIONS': os.environ['ASAN_OPTIONS'] + ':allocator_may_return_null=1:max_allocation_size_mb=512'
                 } if 'ASAN_OPTIONS' in os.environ else {}
        self.process = subprocess.Popen([ctsplat, 'receive', '-O', folder, '--listen', here + ':0', *words],
                                        stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                                        env=dict(os.environ, **limit, **(env or {})))
        atexit.register(self.process.kill)
        said = self.process.stderr.readline()
        assert 'listens at %s:' % here in said, said + self.process.stderr.read()
        self.port = int(said.split(':')[-1].split()[0])

    def files(self):
        return sorted(glob.glob(self.folder + '/ST_*/*.dcm'))

    def lines(self):
        path = self.folder + '/received.jsonl'
        return [json.loads(line) for line in open(path)] if os.path.exists(path) else []

    def wait_for(self, n):
        """That so many associations have been recorded; the last one."""
        end = time.monotonic() + 120
        while True:
            lines = [line for line in self.lines() if line['event'] == 'association']
            if len(lines) >= n:
                return lines[n - 1]
            assert time.monotonic() < end, (n, lines[-3:])
            time.sleep(0.02)

    def connect(self):
        s = socket.create_connection((self.host, self.port), 20)
        s.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return s

    def children(self):
        return open('/proc/%d/task/%d/children' % (self.process.pid, self.process.pid)).read().split()

    def end(self):
        self.process.terminate()
        assert self.process.wait(120) == 0, self.process.stderr.read()
        left = [f for f in os.listdir(self.folder) if f.endswith('.tmp')]
        assert not left, left


def send(receiver, *words, code=0, called='CTSPLAT'):
    done = subprocess.run(['storescu', '-aec', called, *words[:-1], '127.0.0.1', str(receiver.port)] +
                          (words[-1] if isinstance(words[-1], list) else [words[-1]]), capture_output=True)
    assert (done.returncode == 0) == (code == 0), (words, done.returncode, done.stderr)


def until(true, otherwise):
    end = time.monotonic() + 120
    while not true():
        assert time.monotonic() < end, otherwise
        time.sleep(0.02)


def gone(s):
    """The other side hangs up."""
    try:
        while s.recv(4096):
            pass
    except ConnectionError:
        pass
    s.close()


# Stored unchanged, in any syntax, and recorded; sent again, it is the same file; other objects than CT are refused.
r = Receiver('in')
send(r, SLICES)
study, n = uid_of(data_set(SLICES[0]), b'\x20\0\x0d\0'), len(SLICES)
assert len(r.files()) == n and all('/ST_' + study in f for f in r.files())
assert {data_set(f) for f in r.files()} == {data_set(f) for f in SLICES}
assert {os.stat(f).st_mode & 0o777 for f in r.files()} == {0o640}
record = r.wait_for(1)
assert record['objects'] == n and record['replaced'] == 0 and record['calling_aet'] == 'STORESCU' and record['address'] == '127.0.0.1', record
assert record['studies'] == [{'study': 'ST_' + study, 'objects': n}] and record['end'] == 'released', record
subprocess.run(['dcmcjpeg', SLICES[0], 'jpeg.dcm'], check=True)
send(r, '-xs', 'jpeg.dcm')
assert r.wait_for(2)['replaced'] == 1
assert len(r.files()) == n and data_set('jpeg.dcm') in {data_set(f) for f in r.files()}
evil = bytearray(open(SLICES[0], 'rb').read())
at = evil.index(b'\x20\0\x0d\0UI') + 8
evil[at:at + 8] = b'../../x\n'
open('evil.dcm', 'wb').write(evil)
send(r, 'evil.dcm')
assert r.wait_for(3)['studies'][0]['study'].startswith('ST_uid-') and len(r.files()) == n + 1, r.lines()[-1]

# Whom it does not know, and what it does not offer.
send(r, SLICES[0], called='OTHER', code=1)
assert 'another AE title' in r.wait_for(4)['end']
subprocess.run([ctsplat, 'render', data, '--size', '40x30', '-o', 'capture.dcm'], check=True, capture_output=True)
send(r, 'capture.dcm', code=1)
assert r.wait_for(5)['objects'] == 0 and len(r.files()) == n + 1
s = r.connect()
s.sendall(request('A', 'CTSPLAT', '1.2.840.10008.5.1.4.1.1.7', EXPLICIT))
assert s.recv(4096)[:1] == b'\3'
gone(s)
assert 'nothing that is taken' in r.wait_for(6)['end']
again = subprocess.run([ctsplat, 'receive', '-O', 'in', '--listen', '127.0.0.1:0'], capture_output=True, text=True)
assert again.returncode == 1 and 'another receiver' in again.stderr, again.stderr
r.end()
r = Receiver('in2', '--allow', 'FRIEND@127.0.0.0/8', '--allow', '*@192.0.2.1')
send(r, '-aet', 'FRIEND', SLICES[0])
send(r, '-aet', 'FOE', SLICES[0], code=1)
assert 'not allowed' in r.wait_for(2)['end']
r.end()
r = Receiver('in3', '--allow', '*@192.0.2.1')
s = r.connect()
gone(s)
r.end()
assert r.lines()[-1]['event'] == 'turned_away' and r.lines()[-1]['connections'] == 1, r.lines()

with open('/proc/net/if_inet6') as v6:
    has_v6 = v6.read().startswith('0' * 31 + '1')
for allowed in ([], ['--allow', '*@::1/128']) if has_v6 else []:
    r = Receiver('v6-%d' % len(allowed), *allowed, host='::1')
    Association(r.connect(), 'A', 'CTSPLAT', CT, EXPLICIT).socket.close()
    assert r.wait_for(1)['address'] == '::1', r.lines()
    r.end()

# Limits: an object that is too large, an endless one, a disk that is full, silence, dripping, too many at once.
r = Receiver('limits', '--object-size', '0.02', '--peer-timeout', '1', '--association-time', '3', '--per-peer', '3')
big = Association(r.connect(), 'A', 'CTSPLAT', CT, EXPLICIT)
big.send(1, command(sop_class=CT, field=1, message=1, priority=0, has_data=1, sop='1.2.3'), 1)
try:
    while True:
        big.part(1, b'\0' * 16000)
except OSError:
    pass
assert 'larger than allowed' in r.wait_for(1)['end'], r.lines()
drip = Association(r.connect(), 'A', 'CTSPLAT', CT, EXPLICIT)
drip.send(1, command(sop_class=CT, field=1, message=1, priority=0, has_data=1, sop='1.2.3'), 1)
try:
    while True:
        drip.part(1, b'\0\0')
        time.sleep(0.2)
except OSError:
    pass
assert 'longer than it may' in r.wait_for(2)['end'], r.lines()
silent = [r.connect() for _ in range(8)]
until(lambda: len(r.children()) >= 3, 'no children')
time.sleep(0.3)
assert len(r.children()) == 3, r.children()
for s in silent:
    gone(s)
r.wait_for(5)
assert not glob.glob('limits/ST_*') and not r.children()
r.end()
assert sum(line.get('connections', 0) for line in r.lines()) == 5, r.lines()
r = Receiver('full', '--keep-free', '100')
send(r, SLICES[0], code=1)
assert 'disk' in r.wait_for(1)['end'], r.lines()
r.end()
r = Receiver('rate', '--per-minute', '2')
for _ in range(3):
    subprocess.run(['echoscu', '-aec', 'CTSPLAT', '127.0.0.1', str(r.port)], capture_output=True)
r.end()
assert [line['event'] for line in r.lines()] == ['association'] * 2 + ['turned_away'], r.lines()

# Over TLS with a certificate that the authority has signed, and in no other way.
for name, issuer in (('ours', None), ('server', 'ours'), ('client', 'ours'), ('theirs', None), ('stranger', 'theirs')):
    peers.certificate(name, issuer)
r = Receiver('tls', '--tls-key', 'server.key', '--tls-cert', 'server.pem', '--tls-ca', 'ours.pem')
send(r, '+tls', 'client.key', 'client.pem', '+cf', 'ours.pem', SLICES)
assert r.wait_for(1)['certificate'] == '/CN=client' and len(r.files()) == n, r.lines()
for words in (['+tls', 'stranger.key', 'stranger.pem', '-ic'], ['+tla', '-ic'], []):
    send(r, *words, SLICES[0], code=1)
r.wait_for(4)
assert len(r.files()) == n and all(line['objects'] == 0 for line in r.lines()[1:])
r.end()

# Hostile: noise, cut and lying units, and a good sender after all of them. Nothing is left, nothing grows.
chance = random.Random(7)
r = Receiver('hostile', '--per-minute', '100000', '--per-peer', '16', '--peer-timeout', '2')
good = request('A', 'CTSPLAT', CT, EXPLICIT)
store = command(sop_class=CT, field=1, message=1, priority=0, has_data=1, sop='1.2.3')
files = len(os.listdir('/proc/%d/fd' % r.process.pid))
for i in range(10000 if os.environ.get('CTS_SOAK') else 200):
    s = r.connect()
    kind = i % 5
    try:
        if kind == 0:
            s.sendall(bytes(chance.randrange(256) for _ in range(chance.randrange(1, 200))))
        elif kind == 1:
            bad = bytearray(good)
            for _ in range(chance.randrange(1, 6)):
                bad[chance.randrange(6, len(bad))] = chance.randrange(256)
            s.sendall(bad)
        elif kind == 2:
            s.sendall(good[:chance.randrange(1, len(good))])
        elif kind == 3:
            s.sendall(b'\1\0' + struct.pack('>I', chance.choice([0, 1, 0x7fffffff, 0xffffffff])) + bytes(300))
        else:
            s.sendall(good)
            s.recv(4096)
            bad = bytearray(struct.pack('>BBIIBB', 4, 0, len(store) + 6, len(store) + 2, 1, 3) + store)
            for _ in range(chance.randrange(1, 6)):
                bad[chance.randrange(2, len(bad))] = chance.randrange(256)
            s.sendall(bad)
        s.shutdown(socket.SHUT_WR)
    except OSError:
        pass
    gone(s)
assert r.process.poll() is None
until(lambda: not r.children() and len(os.listdir('/proc/%d/fd' % r.process.pid)) == files, 'something is left')
assert not glob.glob('hostile/ST_*')
send(r, SLICES)
assert len(r.files()) == n
rss = int(next(line for line in open('/proc/%d/status' % r.process.pid) if line.startswith('VmRSS')).split()[1])
assert rss < 100e3 or 'ASAN_OPTIONS' in os.environ, rss

# Killing it kills its processes; the next one continues.
held = Association(r.connect(), 'A', 'CTSPLAT', CT, EXPLICIT)
held.send(1, store, 1)
held.part(1, bytes(1000))
until(lambda: glob.glob('hostile/.visitor-*.tmp'), 'nothing is kept')
r.process.send_signal(signal.SIGKILL)
r.process.wait()
gone(held.socket)
r = Receiver('hostile')
assert not glob.glob('hostile/.visitor-*.tmp')
r.end()

# For any failing call, of the receiver or of the process that serves a peer: the receiver continues, and exactly the
# objects confirmed to a sender are there, complete.
shim = os.environ.get('CTS_FAIL_NTH')
calls = ('accept', 'fork'), ('open', 'read', 'write', 'fsync', 'rename', 'malloc')
steps = {'read': 5, 'malloc': 301}
for in_child, call in [(i, call) for i in range(2) for call in calls[i]] if shim else []:
    for n in range(1, 10**6, steps.get(call, 1)):
        fails = {'LD_PRELOAD': shim, 'CTS_FAIL': call, 'CTS_FAIL_AT': str(n), 'CTS_FAIL_MARK': os.path.abspath('record')}
        if in_child:
            fails['CTS_FAIL_CHILD'] = '1'
        folder = '%s-%d' % (call, n)
        r = Receiver(folder, '--peer-timeout', '5', env=fails)
        sent = subprocess.run(['storescu', '-aec', 'CTSPLAT', '127.0.0.1', str(r.port), SLICES[0]], capture_output=True)
        there = r.files()
        assert sent.returncode or len(there) == 1, (call, n, 'stored, and not there')
        assert all(data_set(f) == data_set(SLICES[0]) for f in there), (call, n, 'half a slice')
        if not in_child and sent.returncode:
            send(r, SLICES[0])
        r.end()
        if not os.path.exists('record'):
            break
        os.remove('record')
    assert n > 1, call + ' was not reached'
