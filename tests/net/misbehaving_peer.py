"""A DIMSE peer on a raw socket that lies: another study, too few objects, warnings without counts."""
import glob
import os
import socket
import struct
import sys
import threading

import peers
from dimse import Association, command, data_set, item, items, uid_of

ctsplat, loopback, data = os.path.abspath(sys.argv[1]), sys.argv[2], sys.argv[3]
run = peers.Ctsplat(ctsplat).run
CT, FIND = '1.2.840.10008.5.1.4.1.1.2', '1.2.840.10008.5.1.4.1.2.2.1'
MOVE, GET = '1.2.840.10008.5.1.4.1.2.2.2', '1.2.840.10008.5.1.4.1.2.2.3'
EXPLICIT = '1.2.840.10008.1.2.1'


class Peer:
    """Serves one association after the other; `answer` is (objects, end of the C-GET, count by C-FIND or None)."""

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
                ways.append(Association(socket.create_connection(('127.0.0.1', self.move_port), 20), 'LIAR', 'CTSPLAT', CT,
                                        EXPLICIT))
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
                if count is not None:
                    text = str(count).encode() + b' ' * (len(str(count)) % 2)
                    uid = series.encode() + b'\0' * (len(series) % 2)
                    found = struct.pack('<HH2sH', 0x20, 0xe, b'UI', len(uid)) + uid
                    found += struct.pack('<HH2sH', 0x20, 0x1209, b'IS', len(text)) + text
                    self.send(context, command(sop_class=FIND, field=0x8020, answers=request, has_data=1, status=0xff00), 1)
                    self.send(context, found, 0)
                self.send(context, command(sop_class=FIND, field=0x8020, answers=request, has_data=0x101, status=0), 1)
                continue
            if asked[0x100] == b'\x21\0':
                held = self.store_elsewhere(objects)
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
