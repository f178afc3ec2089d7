"""Peers for tests: Orthanc, storescp, a proxy that breaks a connection, a small DICOMweb server. Loopback only."""
import http.server
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.request
import zlib


def skip(why):
    print('skipped: ' + why)
    sys.exit(77)


def need(*programs):
    for program in programs:
        if not shutil.which(program):
            skip('no ' + program)


def ports():
    """Each script has two hundred of its own, below those that the system gives away, so that scripts run side by side."""
    first = 20000 + zlib.crc32(os.path.basename(sys.argv[0]).encode()) % 60 * 200
    for port in range(first, first + 200):
        with socket.socket() as s:
            try:
                s.bind(('127.0.0.1', port))
            except OSError:
                continue
        yield port


numbers = ports()


def free_port():
    return next(numbers)


def wait_for_port(port, process, seconds=200):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        try:
            socket.create_connection(('127.0.0.1', port), 1).close()
            return
        except OSError:
            assert process.poll() is None, 'the peer ended with %s' % process.returncode
            time.sleep(0.05)
    raise AssertionError('the peer does not come up')


def certificate(name, issuer=None, days='2', host='IP:127.0.0.1'):
    """NAME.key and NAME.pem for a host, signed by another one's key, or an authority's own."""
    def openssl(*words):
        subprocess.run(['openssl', *words], check=True, capture_output=True)

    if not issuer:
        return openssl('req', '-x509', '-newkey', 'rsa:2048', '-nodes', '-keyout', name + '.key', '-out', name + '.pem',
                       '-days', days, '-subj', '/CN=' + name)
    with open(name + '.ext', 'w') as f:
        f.write('subjectAltName=' + host)
    openssl('req', '-newkey', 'rsa:2048', '-nodes', '-keyout', name + '.key', '-out', name + '.csr', '-subj',
            '/CN=' + name)
    openssl('x509', '-req', '-extfile', name + '.ext', '-in', name + '.csr', '-CA', issuer + '.pem', '-CAkey',
            issuer + '.key', '-CAcreateserial', '-out', name + '.pem', '-days', days)


class Orthanc:
    """A PACS with DICOM and DICOMweb; killed and started again it still has what it confirmed."""

    def __init__(self, folder, loopback, user=None, tls=None, more=None):
        self.folder, self.loopback, self.user = folder, loopback, user
        self.http, self.dicom, self.listener = free_port(), free_port(), free_port()
        self.url = 'http://127.0.0.1:%d' % self.http
        # Debian 13's DicomWeb has thumbnails of its own: the first that knows an address answers.
        plugins = [p for p in map('/usr/share/orthanc/plugins/libOrthanc{}.so'.format, ('Python', 'DicomWeb')) if os.path.exists(p)]
        os.makedirs(folder)
        config = {
            'Name': 'test', 'StorageDirectory': folder, 'IndexDirectory': folder, 'HttpPort': self.http,
            'RemoteAccessAllowed': False, 'AuthenticationEnabled': bool(user),
            'RegisteredUsers': dict([user]) if user else {}, 'DicomAet': 'ORTHANC', 'DicomPort': self.dicom,
            'DicomCheckCalledAet': True, 'DicomAlwaysAllowStore': False, 'Plugins': plugins,
            'DicomModalities': {'ctsplat': {'AET': 'CTSPLAT', 'Host': '127.0.0.1', 'Port': self.listener,
                                            'AllowGet': True, 'AllowMove': True, 'AllowFind': True}},
            'DicomWeb': {'Enable': True, 'Root': '/dicom-web/'}, **(more or {})}
        if tls: # the name of its key and certificate, and of the authority's
            config['DicomModalities']['ctsplat']['UseDicomTls'] = True
            config.update({'DicomTlsEnabled': True, 'DicomTlsPrivateKey': os.path.abspath(tls[0] + '.key'),
                           'DicomTlsCertificate': os.path.abspath(tls[0] + '.pem'),
                           'DicomTlsTrustedCertificates': os.path.abspath(tls[1] + '.pem')})
        with open(folder + '.json', 'w') as f:
            json.dump(config, f)
        self.start()

    def start(self):
        log = open(self.folder + '.log', 'ab')
        self.process = subprocess.Popen(['Orthanc', self.folder + '.json'], stdin=subprocess.DEVNULL, stdout=log,
                                        stderr=log, env=dict(os.environ, LD_PRELOAD=self.loopback))
        wait_for_port(self.http, self.process)
        wait_for_port(self.dicom, self.process)

    def kill(self):
        self.process.kill()
        self.process.wait()

    def get(self, path, accept=None):
        request = urllib.request.Request(self.url + path, headers={'Accept': accept} if accept else {})
        return urllib.request.urlopen(request, timeout=120).read()

    def json(self, path):
        return json.loads(self.get(path, 'application/json'))

    def put(self, path):
        with open(path, 'rb') as f:
            request = urllib.request.Request(self.url + '/instances', data=f.read())
        urllib.request.urlopen(request, timeout=120).read()

    def instances(self):
        return self.json('/statistics')['CountInstances']


class Storescp:
    """DCMTK's storescp; a file for each object that it was sent, however often."""

    def __init__(self, folder, loopback, port=None):
        self.folder, self.port = folder, port or free_port()
        os.makedirs(folder, exist_ok=True)
        self.process = subprocess.Popen(['storescp', '--aetitle', 'ARCHIVE', '--accept-all', '--unique-filenames',
                                         '--output-directory', folder, str(self.port)], stdin=subprocess.DEVNULL,
                                        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                                        env=dict(os.environ, LD_PRELOAD=loopback))
        wait_for_port(self.port, self.process)

    def count(self):
        return len(os.listdir(self.folder))

    def end(self):
        self.process.kill()
        self.process.wait()


class Proxy:
    """Passes connections on; calls broken() and cuts the first one after so many bytes."""

    def __init__(self, to, cut_after, broken, pause=0):
        self.to, self.cut_after, self.broken, self.pause = to, cut_after, broken, pause
        self.connections = 0
        self.socket = socket.create_server(('127.0.0.1', 0))
        self.port = self.socket.getsockname()[1]
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            client, _ = self.socket.accept()
            self.connections += 1
            cut = self.cut_after if self.connections == 1 else None
            threading.Thread(target=self.serve, args=(client, cut), daemon=True).start()

    def serve(self, client, cut):
        try:
            server = socket.create_connection(('127.0.0.1', self.to), 30)
        except OSError:
            client.close()
            return
        threading.Thread(target=self.pump, args=(server, client, None), daemon=True).start()
        if self.pump(client, server, cut):
            self.broken()
        for s in (client, server):
            try:
                s.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass
            s.close()

    def pump(self, a, b, cut):
        passed = 0
        while True:
            try:
                data = a.recv(16384)
                if not data:
                    b.shutdown(socket.SHUT_WR)
                    return False
                b.sendall(data)
                time.sleep(self.pause)
            except OSError:
                return False
            passed += len(data)
            if cut and passed > cut:
                return True


class Web(http.server.ThreadingHTTPServer):
    """Answers with given status, headers and body, or those of a function, and records the requests."""
    daemon_threads = True

    def __init__(self):
        self.asked, self.answer = [], (200, {}, b'')
        server = self

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self):
                server.asked.append((self.path, dict(self.headers)))
                status, headers, body = server.answer() if callable(server.answer) else server.answer
                self.send_response(status)
                for name, value in headers.items():
                    self.send_header(name, value)
                self.end_headers()
                self.wfile.write(body)

            def do_POST(self):
                server.posted = self.rfile.read(int(self.headers['Content-Length']))
                self.do_GET()

            def log_message(self, *_):
                pass

        self.posted = b''
        super().__init__(('127.0.0.1', 0), Handler)
        self.url = 'http://127.0.0.1:%d/rs' % self.server_address[1]
        threading.Thread(target=self.serve_forever, daemon=True).start()


    def stored(self):
        """The answer that names what was posted last as stored."""
        at = self.posted.index(b'\x08\0\x18\0UI') + 8
        uid = self.posted[at:at + int.from_bytes(self.posted[at - 2:at], 'little')].rstrip(b'\0').decode()
        body = json.dumps({'00081199': {'vr': 'SQ', 'Value': [{'00081155': {'vr': 'UI', 'Value': [uid]}}]}}).encode()
        return 200, {'Content-Type': 'application/dicom+json', 'Content-Length': str(len(body))}, body


class Ctsplat:
    def __init__(self, program):
        self.program = program
        os.makedirs('tmp', exist_ok=True)

    def compare(self, a, b):
        """Equal to the last bit of what the two files can hold."""
        done = subprocess.run([self.program, 'compare', a, b, '--json'], capture_output=True, text=True)
        return json.loads(done.stdout)['max'] < 1 / 255 / 2

    def run(self, *args, code=0, env=None, interrupt_after=None):
        full = dict(os.environ, TMPDIR=os.path.abspath('tmp'), **(env or {}))
        process = subprocess.Popen([self.program, 'render'] + list(args), stdin=subprocess.DEVNULL,
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=full)
        if interrupt_after:
            time.sleep(interrupt_after)
            assert process.poll() is None, 'it ended before it could be interrupted'
            process.send_signal(signal.SIGINT)
        said = process.communicate()[1]
        assert process.returncode == code, (args, process.returncode, said)
        assert not os.listdir('tmp'), 'a folder is left: %s' % os.listdir('tmp')
        return said
