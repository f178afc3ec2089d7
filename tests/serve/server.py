"""A ctsplat server for a test, and requests to it."""
import contextlib
import http.client
import json
import os
import re
import subprocess
import tempfile


class Server:
    """Runs while the `with` lasts; ends with SIGTERM, and must leave nothing."""

    tls = None  # or the verification of its certificate

    def __init__(self, ctsplat, *args, listen='127.0.0.1:0'):
        self.folder = tempfile.mkdtemp(dir=os.getcwd())
        self.command = [ctsplat, 'serve', *args, '--listen', listen]

    def __enter__(self):
        env = {**os.environ, 'TMPDIR': self.folder}
        self.errors = open(self.folder + '.err', 'w+')
        self.process = subprocess.Popen(self.command, stdout=subprocess.PIPE, stderr=self.errors, text=True, env=env)
        self.url = self.process.stdout.readline().strip()
        found = re.fullmatch(r'(https?)://([^/]+):(\d+)/(?:\?token=(\w+))?', self.url)
        assert found or self.url.startswith('unix:'), (self.url, self.stderr())
        if found:
            self.host, self.port, self.token = found[2], int(found[3]), found[4]
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.terminate()
        code = self.process.wait(200)
        self.process.stdout.close()
        said = self.stderr()
        self.errors.close()
        assert code == 0, (code, said)
        os.rmdir(self.folder)

    def stderr(self):
        self.errors.seek(0)
        return self.errors.read()

    def kib(self):
        """Its memory in use."""
        with open(f'/proc/{self.process.pid}/status') as f:
            return int(re.search(r'VmRSS:\s+(\d+)', f.read())[1])

    def sockets(self):
        folder = f'/proc/{self.process.pid}/fd/'
        count = 0
        for name in os.listdir(folder):
            with contextlib.suppress(FileNotFoundError):  # closed since it was listed
                count += os.readlink(folder + name).startswith('socket:')
        return count

    def ask(self, path, headers=None, method='GET', token=True, timeout=120):
        """Status, headers and body."""
        connection = http.client.HTTPSConnection(self.host, self.port, timeout=timeout, context=self.tls) if self.tls else \
            http.client.HTTPConnection(self.host, self.port, timeout=timeout)
        own = {'Authorization': 'Bearer ' + self.token} if token and self.token else {}
        try:
            connection.request(method, path, headers={**own, **(headers or {})})
            answer = connection.getresponse()
            return answer.status, answer.headers, answer.read()
        finally:
            connection.close()

    def get(self, path, headers=None):
        status, _, body = self.ask(path, headers)
        assert status == 200, (path, status, body[:300])
        return body

    def refused(self, expected, text, path, **more):
        status, headers, body = self.ask(path, **more)
        assert status == expected, (path, status, body[:300])
        assert re.search(text, body.decode()) and body.count(b'\n') == 1, (path, body)
        return headers

    def series(self):
        return json.loads(self.get('/series'))
