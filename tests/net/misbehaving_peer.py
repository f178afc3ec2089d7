"""A DIMSE peer on a raw socket that lies: another study, too few objects, warnings without counts."""
import glob
import json
import os
import socket
import struct
import subprocess
import sys
import threading

import peers
from dimse import Association, command, data_set, item, items, uid_of

ctsplat, loopback, data = os.path.abspath(sys.argv[1]), sys.argv[2], sys.argv[3]
run = peers.Ctsplat(ctsplat).run
CT, FIND = '1.2.840.10008.5.1.4.1.1.2', '1.2.840.10008.5.1.4.1.2.2.1'
MOVE, GET = '1.2.840.10008.5.1.4.1.2.2.2', '1.2.840.10008.5.1.4.1.2.2.3'
EXPLICIT = '1.2.840.10008.1.2.1'


def element(tag, vr, value):
    value += (b'\0' if vr == 'UI' else b' ') * (len(value) % 2)
    return struct.pack('<HH2sH', tag >> 16, tag & 0xffff, vr.encode(), len(value)) + value


class Peer:
    """Serves one association after the other; `answer` is (objects, end of the C-GET, count by C-FIND or None); `found`,
    unless empty, the answers to C-FIND: by the level's first letter lists of {tag: (VR, bytes)}."""
    found, pending, called = {}, 0xff00, 'CTSPLAT'

    def __init__(self):
        self.answer = ([], {}, None)
        self.server = socket.create_server(('127.0.0.1', 0))
        self.name = 'LIAR@127.0.0.1:%d' % self.server.getsockname()[1]
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            self.socket = self.server.accept()[0]
            self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            try:
                self.serve()
            except (OSError, struct.error):
                pass
            self.socket.close()

    def receive(self, n):
        data = b''
        while len(data) < n:
            part = self.socket.recv(n - len(data))
            if not part:
                raise OSError
            data += part
        return data

    def pdu(self):
        kind, _, n = struct.unpack('>BBI', self.receive(6))
        return kind, self.receive(n)

    def message(self):
        """A command's fields, and the data set that follows it."""
        parts, fields = {0: b'', 1: b''}, None
        while True:
            kind, body = self.pdu()
            if kind != 4:
                if kind == 5:
                    self.socket.sendall(struct.pack('>BBII', 6, 0, 4, 0))
                raise OSError
            at = 0
            while at < len(body):
                n, context, flags = struct.unpack_from('>IBB', body, at)
                parts[flags & 1] += body[at + 6:at + 4 + n]
                at += 4 + n
                if flags == 3:
                    fields, raw, p = {}, parts[1], 0
                    while p < len(raw):
                        _, tag, size = struct.unpack_from('<HHI', raw, p)
                        fields[tag] = raw[p + 8:p + 8 + size]
                        p += 8 + size
                if fields and (flags == 2 or fields[0x800] == b'\1\1'):
                    self.keys = parts[0]
                    return context, fields

    def send(self, context, body, is_command):
        while True:
            part, body = body[:16000], body[16000:]
            pdv = struct.pack('>IBB', len(part) + 2, context, is_command | (0 if body else 2)) + part
            self.socket.sendall(struct.pack('>BBI', 4, 0, len(pdv)) + pdv)
            if not body:
                return

    def store_elsewhere(self, objects):
        """By C-MOVE, to the other side's port: in turn over three associations that all stay open."""
        ways = []
        for k, one in enumerate(objects):
            if len(ways) < 3:
                ways.append(Association(socket.create_connection(('127.0.0.1', self.move_port), 20), 'LIAR', self.called,
                                        CT, EXPLICIT))
            way = ways[k % 3]
            way.send(1, command(sop_class=CT, field=1, message=k + 1, priority=0, has_data=1,
                                sop=uid_of(one, b'\x08\0\x18\0')), 1)
            way.send(1, one, 0)
            kind = way.receive()
            assert kind == 4, ('not stored', k, kind)
        return ways

    def serve(self):
        _, body = self.pdu()
        contexts, reply, roles = {}, b'', b''
        for kind, value in items(body[68:]):
            if kind == 0x20:
                syntaxes = [v.decode().rstrip('\0') for k, v in items(value[4:]) if k == 0x40]
                abstract = next(v for k, v in items(value[4:]) if k == 0x30).decode().rstrip('\0')
                takes = EXPLICIT in syntaxes
                if takes:
                    contexts[abstract] = value[0]
                reply += item(0x21, bytes([value[0], 0, 0 if takes else 4, 0]) + item(0x40, EXPLICIT.encode()))
            elif kind == 0x50:
                roles = b''.join(item(k, v) for k, v in items(value) if k == 0x54)
        user = item(0x50, item(0x51, struct.pack('>I', 16384)) + item(0x52, b'1.2.3') + roles)
        reply = body[:68] + item(0x10, b'1.2.840.10008.3.1.1.1') + reply + user
        self.socket.sendall(struct.pack('>BBI', 2, 0, len(reply)) + reply)
        while True:
            context, asked = self.message()
            request, objects, end, count = struct.unpack('<H', asked[0x110])[0], *self.answer
            if asked[0x100] == b'\x20\0':
                of_count = [{0x20000e: ('UI', series.encode()), 0x201209: ('IS', str(count).encode())}]
                level = 'S' if b'STUDY' in self.keys else 's'
                for one in self.found.get(level, []) if self.found else of_count if count is not None else []:
                    self.send(context, command(sop_class=FIND, field=0x8020, answers=request, has_data=1,
                                               status=self.pending), 1)
                    self.send(context, b''.join(element(tag, *one[tag]) for tag in sorted(one)), 0)
                self.send(context, command(sop_class=FIND, field=0x8020, answers=request, has_data=0x101, status=0), 1)
                continue
            if asked[0x100] == b'\x21\0':
                try:
                    held = self.store_elsewhere(objects)
                except AssertionError:
                    end = {'status': 0xa702}
                self.send(context, command(sop_class=MOVE, field=0x8021, answers=request, has_data=0x101, **end), 1)
                continue
            for k, one in enumerate(objects):
                self.send(contexts[CT], command(sop_class=CT, field=1, message=k + 1, priority=0, has_data=1,
                                                sop=uid_of(one, b'\x08\0\x18\0')), 1)
                self.send(contexts[CT], one, 0)
                self.message()
            self.send(context, command(sop_class=GET, field=0x8010, answers=request, has_data=0x101, **end), 1)


whole = [data_set(path) for path in sorted(glob.glob(data + '/*.dcm'))]
study, series = uid_of(whole[0], b'\x20\0\x0d\0'), uid_of(whole[0], b'\x20\0\x0e\0')
other = [one.replace(study.encode(), study[:-1].encode() + b'0') for one in whole]
peer = Peer()
fetch = ['--from', peer.name, '--study-uid', study, '--size', '32x32']
of_series = fetch + ['--series-uid', series]
good = {'status': 0, 'completed': 48, 'failed': 0, 'warned': 0}

for answer in ((whole, good, None), (whole, {'status': 0}, None), (whole, good, 48), (whole, {'status': 0}, 48),
               (whole, dict(good, status=0xb000), None)):
    peer.answer = answer
    run(*of_series, '-o', 'right.png', '--force')
peer.answer = (whole, good, 48)
run(*fetch, '-o', 'right.png', '--force')
peer.move_port = peers.free_port()
run(*of_series, '--move-port', str(peer.move_port), '-o', 'moved.png')
assert open('moved.png', 'rb').read() == open('right.png', 'rb').read()

for answer, says in (((other, good, 48), 'another study'), ((whole[:-1] + other[-1:], good, 48), 'another study'),
                     ((whole[:6], good, None), '6 of 48 objects came'), ((whole[:6], {'status': 0}, 48), '6 of 48'),
                     ((whole[:6] * 8, good, 48), '6 of 48'), ((whole[:6], {'status': 0xb000}, None), 'does not say'),
                     ((whole, {'status': 0xb000, 'completed': 47, 'failed': 1}, None), 'could not send 1'),
                     ((whole, {'status': 0xa700}, None), 'refuses')):
    peer.answer = answer
    said = run(*of_series, '-o', 'none.png', code=3)
    assert says in said and said.count('\n') == 1 and not os.path.exists('none.png'), (says, said)
    assert study[:-1] not in said, said
peer.answer = (whole, good, 48)
said = run(*fetch, '--series-uid', '1.2.3', '-o', 'none.png', code=3)
assert 'another series' in said, said
# Of a whole study, a series that does not come whole is left out, and no slice of it stays.
peer.answer = (whole[:6], {'status': 0}, 48)
run(*fetch, '-o', 'none.png', code=3)

# Our own listener refuses the objects of a C-MOVE to another AE title: the reason is ours, not the peer's.
peer.answer, peer.called = (whole, good, None), 'OTHER'
said = run(*of_series, '--move-port', str(peer.move_port), '-o', 'none.png', code=3)
assert 'A702' in said and 'our listener refused' in said and 'calls AE title OTHER, not CTSPLAT' in said, said


def find(*query, code=0):
    done = subprocess.run([ctsplat, 'info', '--json', '--from', peer.name, '--modality', '*', *query], capture_output=True, text=True)
    assert done.returncode == code, (query, done.returncode, done.stderr)
    return sorted(s['series_uid'] for s in json.loads(done.stdout)['series']) if not code else [], done.stderr


def studies(*patients, charset=None):
    """A study 1.N and its series 1.N.1 for each patient; the series are listed for every study, and 1.2 twice."""
    peer.found = {'S': [], 's': []}
    for n, patient in enumerate(patients, 1):
        uid = b'1.%d' % n
        peer.found['S'] += [{0x20000d: ('UI', uid + b' '), 0x80020: ('DA', b'202%d0101' % n), 0x80050: ('SH', b' A%d ' % n),
                             **({0x100020: ('LO', patient)} if patient is not None else {}),
                             **({0x80005: ('CS', charset)} if charset else {})}] * (2 if n == 2 else 1)
        peer.found['s'] += [{0x20000d: ('UI', uid), 0x20000e: ('UI', uid + b'.1'), 0x80060: ('CS', b'CT' if n < 3 else b'MR'),
                             0x201209: ('IS', b'12')}] * (2 if n == 2 else 1)


# Answers that contradict a key are left out, others once.
for patients, query, expected in (
        ([b'P1', b'P2 ', b'P3'], ['--patient-id', 'P2'], ['1.2.1']),
        ([b'P1', b'P2', b'P3'], ['--patient-id', 'P*'], ['1.1.1', '1.2.1', '1.3.1']),
        ([b'P1', b'P22', b'XP2'], ['--patient-id', 'P?'], ['1.1.1']),
        ([b'P1', None, b''], ['--patient-id', 'P2'], ['1.2.1', '1.3.1']),
        ([b'P1', b'P2', b'P3'], ['--study-date', '20220101-'], ['1.2.1', '1.3.1']),
        ([b'P1', b'P2', b'P3'], ['--study-date', '-20220101'], ['1.1.1', '1.2.1']),
        ([b'P1', b'P2', b'P3'], ['--study-date', '20210102-20221231'], ['1.2.1']),
        ([b'P1', b'P2', b'P3'], ['--accession', 'A3'], ['1.3.1']),
        ([b'P1', b'P2', b'P3'], ['--study-uid', '1.2'], ['1.2.1']),
        ([b'P1', b'P2', b'P3'], ['--patient-id', '*', '--modality', 'MR'], ['1.3.1']),
        ([b'P1', b'P2', b'P3'], ['--patient-id', '*', '--series-uid', '1.1.1'], ['1.1.1'])):
    studies(*patients)
    got, said = find(*query)
    assert got == expected, (query, got, expected, said)
    assert 'left out' in said, (query, said)
for charset, patients in ((b'ISO_IR 100', ['MÜ1', 'MÖ1']), (b'ISO_IR 192', ['MÜ1', 'MÖ1'])):
    studies(*(p.encode('utf-8' if b'192' in charset else 'latin-1') for p in patients), charset=charset)
    assert find('--patient-id', 'MÜ1')[0] == ['1.1.1'], charset
studies('MÜ1'.encode('latin-1'), b'MA1') # without its character set nothing is contradicted
assert find('--patient-id', 'MÜ1')[0] == ['1.1.1']
studies(b'P1', b'P2')
peer.pending = 0xff01
assert 'FF01' in find('--patient-id', 'P2')[1]
studies(b'P1', b'P3')
assert 'no such series' in find('--patient-id', 'P2', code=3)[1]
