"""C-STORE over TLS: the right certificate is taken; a wrong, an expired, another host's and none at all are not."""
import glob
import os
import subprocess
import sys

import peers

ctsplat, loopback, data = os.path.abspath(sys.argv[1]), sys.argv[2], sys.argv[3]
peers.need('openssl', 'storescp')
run = peers.Ctsplat(ctsplat).run
inbox = 'inbox'
os.mkdir(inbox)


peers.certificate('ours')
peers.certificate('theirs')
for name in ('server', 'client'):
    peers.certificate(name, 'ours')
peers.certificate('stranger', 'theirs')
peers.certificate('old', 'ours', days='0')  # expired at once; openssl 3.5 takes no negative number
peers.certificate('elsewhere', 'ours', host='IP:192.0.2.1,DNS:pacs.example.org')


class Storescp:
    def __init__(self, key, *options):
        self.port = peers.free_port()
        self.process = subprocess.Popen(
            ['storescp', '+tls', key + '.key', key + '.pem', '+cf', 'ours.pem', '-od', inbox] + list(options) +
            [str(self.port)], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            env=dict(os.environ, LD_PRELOAD=loopback))
        peers.wait_for_port(self.port, self.process)

    def send(self, name, *options, code=0):
        said = run(data, '--size', '40x30', '-o', name + '.dcm', '--peer-timeout', '5', '--send',
                   'STORESCP@127.0.0.1:%d' % self.port, *options, code=code)
        assert os.path.exists(name + '.dcm')
        if code:
            assert name + '.dcm' in said and said.count('\n') == 1, said
        return len(glob.glob(inbox + '/*'))


def stop(peer):
    peer.process.terminate()
    peer.process.wait()


right = Storescp('server')
assert right.send('both', '--tls-ca', 'ours.pem', '--tls-key', 'client.key', '--tls-cert', 'client.pem') == 1
assert right.send('wrong-ca', '--tls-ca', 'theirs.pem', '--tls-key', 'client.key', '--tls-cert', 'client.pem',
                  code=5) == 1
assert right.send('stranger', '--tls-ca', 'ours.pem', '--tls-key', 'stranger.key', '--tls-cert', 'stranger.pem',
                  '--view', 'left', code=5) == 1
assert right.send('plain', '--view', 'left', code=5) == 1
stop(right)

open_to_all = Storescp('server', '-ic')
assert open_to_all.send('anonymous', '--tls-ca', 'ours.pem', '--view', 'head') == 2
stop(open_to_all)

expired = Storescp('old', '-ic')
assert expired.send('expired', '--tls-ca', 'ours.pem', '--view', 'feet', code=5) == 2
stop(expired)

elsewhere = Storescp('elsewhere', '-ic')
assert elsewhere.send('elsewhere', '--tls-ca', 'ours.pem', '--view', 'feet', code=5) == 2
stop(elsewhere)

# Keys that are none, or do not fit, are named before anything is sent.
run(data, '--size', '40x30', '-o', 'a.dcm', '--tls-ca', 'ours.pem', '--tls-key', 'client.key', '--tls-cert',
    'server.pem', '--send', 'STORESCP@127.0.0.1:1', code=5)
run(data, '--size', '40x30', '-o', 'b.dcm', '--tls-key', 'client.key', '--send', 'STORESCP@127.0.0.1:1', code=2)
