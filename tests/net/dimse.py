"""DICOM's network messages by hand (PS3.7, PS3.8), for peers that do not keep to them."""
import struct


def data_set(path):
    data = open(path, 'rb').read()
    return data[144 + struct.unpack_from('<I', data, 140)[0]:]


def uid_of(data, tag):
    at = data.index(tag + b'UI') + 8
    return data[at:at + struct.unpack_from('<H', data, at - 2)[0]].rstrip(b'\0').decode()


def items(data):
    at = 0
    while at < len(data):
        kind, n = data[at], struct.unpack_from('>H', data, at + 2)[0]
        yield kind, data[at + 4:at + 4 + n]
        at += 4 + n


def item(kind, body):
    return struct.pack('>BBH', kind, 0, len(body)) + body


def command(**fields):
    tags = {'sop_class': (2, 'u'), 'field': (0x100, 'w'), 'message': (0x110, 'w'), 'answers': (0x120, 'w'),
            'priority': (0x700, 'w'), 'has_data': (0x800, 'w'), 'status': (0x900, 'w'), 'sop': (0x1000, 'u'),
            'remaining': (0x1020, 'w'), 'completed': (0x1021, 'w'), 'failed': (0x1022, 'w'), 'warned': (0x1023, 'w')}
    out = b''
    for tag, kind, value in sorted((*tags[name], value) for name, value in fields.items() if value is not None):
        body = struct.pack('<H', value) if kind == 'w' else value.encode() + b'\0' * (len(value) % 2)
        out += struct.pack('<HHI', 0, tag, len(body)) + body
    return struct.pack('<HHII', 0, 0, 4, len(out)) + out


def request(calling, called, sop_class, syntax):
    """An A-ASSOCIATE-RQ of one presentation context, number 1."""
    context = item(0x20, bytes([1, 0, 0, 0]) + item(0x30, sop_class.encode()) + item(0x40, syntax.encode()))
    user = item(0x50, item(0x51, struct.pack('>I', 16384)) + item(0x52, b'1.2.3'))
    body = struct.pack('>HH', 1, 0) + called.ljust(16).encode() + calling.ljust(16).encode() + bytes(32)
    body += item(0x10, b'1.2.840.10008.3.1.1.1') + context + user
    return struct.pack('>BBI', 1, 0, len(body)) + body


class Association:
    """That the other side has accepted."""

    def __init__(self, connection, *words):
        self.socket = connection
        self.stream = connection.makefile('rb')
        connection.sendall(request(*words))
        assert self.receive() == 2, 'not accepted'

    def send(self, context, body, is_command):
        self.part(context, body, is_command | 2)

    def receive(self):
        """A whole PDU: its kind."""
        kind, _, n = struct.unpack('>BBI', self.stream.read(6))
        self.stream.read(n)
        return kind

    def part(self, context, body, flags=0):
        pdv = struct.pack('>IBB', len(body) + 2, context, flags) + body
        self.socket.sendall(struct.pack('>BBI', 4, 0, len(pdv)) + pdv)
