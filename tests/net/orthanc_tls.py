"""Orthanc and ctsplat over TLS, each with a certificate: what it has is fetched both ways."""
import glob
import os
import sys

import peers

ctsplat, loopback, data = os.path.abspath(sys.argv[1]), sys.argv[2], sys.argv[3]
peers.need('Orthanc', 'openssl')
run = peers.Ctsplat(ctsplat).run
peers.certificate('authority')
for name in ('pacs', 'node'):
    peers.certificate(name, 'authority')
tls = ['--tls-key', 'node.key', '--tls-cert', 'node.pem', '--tls-ca', 'authority.pem']
pacs = peers.Orthanc(os.path.abspath('archive'), loopback, tls=('pacs', 'authority'))
try:
    slices = glob.glob(data + '/*.dcm')
    for path in slices:
        pacs.put(path)
    study = pacs.json('/studies')[0]
    uid = pacs.json('/studies/' + study)['MainDicomTags']['StudyInstanceUID']

    run(data, '--size', '40x30', '-o', 'files.png')
    for name, way in (('get', []), ('move', ['--move-port', str(pacs.listener)])):
        run('--from', 'ORTHANC@127.0.0.1:%d' % pacs.dicom, '--study-uid', uid, *way, *tls, '--size', '40x30', '-o',
            name + '.png')
        assert open(name + '.png', 'rb').read() == open('files.png', 'rb').read(), name
finally:
    pacs.kill()
