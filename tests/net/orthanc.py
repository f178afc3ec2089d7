"""There and back: a CT series in Orthanc, fetched in each way, its pictures sent back in each way, found by DICOMweb;
and nothing lost or doubled when the PACS is killed in between."""
import glob
import json
import os
import socket
import subprocess
import sys
import threading
import time

import peers

ctsplat, loopback, data = os.path.abspath(sys.argv[1]), sys.argv[2], sys.argv[3]
peers.need('Orthanc')
if not glob.glob('/usr/share/orthanc/plugins/*DicomWeb*') + glob.glob('/usr/lib/orthanc/plugins/*DicomWeb*'):
    peers.skip("no DICOMweb plugin of Orthanc's")
try:
    import pydicom
except ImportError:
    peers.skip('no pydicom')

run = peers.Ctsplat(ctsplat).run
pacs = peers.Orthanc(os.path.abspath('pacs'), loopback)
look = ['--size', '90x70', '--preset', 'bone']
try:
    slices = sorted(glob.glob(data + '/*.dcm'))
    for path in slices:
        pacs.put(path)
    source = pydicom.dcmread(slices[0], stop_before_pixels=True)
    study, series = source.StudyInstanceUID, source.SeriesInstanceUID
    dimse, web = 'ORTHANC@127.0.0.1:%d' % pacs.dicom, pacs.url + '/dicom-web'

    # Fetched in each way, the series gives the picture that its files give.
    run(data, *look, '-o', 'files.png', '-o', 'files.dcm')
    truth = open('files.png', 'rb').read()
    ways = {'get': ['--from', dimse, '--study-uid', study, '--series-uid', series],
            'study': ['--from', dimse, '--study-uid', study],
            'move': ['--from', dimse, '--study-uid', study, '--move-port', str(pacs.listener)],
            'wado': ['--from', web, '--study-uid', study, '--series-uid', series]}
    took = {}
    for name, way in ways.items():
        start = time.monotonic()
        run(*way, *look, '-o', name + '.png', '-o', name + '.dcm')
        took[name] = time.monotonic() - start
        assert open(name + '.png', 'rb').read() == truth, name

    # Other connections to our port while the PACS sends block nothing, and add nothing.
    def visit():
        end = time.monotonic() + 200
        while not visited and time.monotonic() < end:
            try:
                held.append(socket.create_connection(('127.0.0.1', pacs.listener), 1))
                stranger = socket.create_connection(('127.0.0.1', pacs.listener), 1, ('127.0.0.2', 0))
                visited.append(stranger.recv(1) == b'')
            except OSError:
                time.sleep(0.001)

    held, visited = [], []
    visitor = threading.Thread(target=visit)
    visitor.start()
    start = time.monotonic()
    run(*ways['move'], *look, '-o', 'visited.png')
    visitor.join()
    assert visited == [True]
    # Nothing waits for the end of a held connection; on a busy machine the move itself takes long.
    assert open('visited.png', 'rb').read() == truth and time.monotonic() - start < 25 + 2 * took['move']

    # Its series are found by each query; a batch fetches each once, and renders new ones.
    def ask(*words, code=0):
        done = subprocess.run([ctsplat, *words], capture_output=True, text=True,
                              env=dict(os.environ, TMPDIR=os.path.abspath('tmp')))
        assert done.returncode == code and not os.listdir('tmp'), (words, done.returncode, done.stderr)
        print(words, done.stderr) # shown where the test fails
        return done

    patient, date = source.PatientID, source.StudyDate
    for peer in (dimse, web):
        for query in (['--study-uid', study], ['--patient-id', patient[:3] + '*', '--study-date', date + '-' + date]):
            found = json.loads(ask('info', '--from', peer, '--json', *query).stdout)['series']
            assert found == [{'series_uid': series, 'study_uid': study, 'modality': 'CT', 'objects': len(slices)}], found
        said = ask('info', '--from', peer, '--patient-id', patient, '--show-patient').stdout
        assert date in said and series in said, said
        for query in (['--patient-id', 'unknown'], ['--patient-id', patient, '--modality', 'MR'],
                      ['--accession', '../x&y=z#']):
            ask('info', '--from', peer, *query, code=3)
        for query in ([], ['--modality', 'CT'], ['--patient-id', 'a\\b'], ['--study-uid', '1..2']):
            ask('info', '--from', peer, *query, code=2)
        words = ['batch', '--from', peer, '--patient-id', patient, '-O', 'batch-' + peer[:4], *look]
        assert '1 of 1 series done:' in ask(*words).stderr
        assert open(glob.glob('batch-' + peer[:4] + '/*/*.png')[0], 'rb').read() == truth
        assert '(1 of them in earlier runs)' in ask(*words).stderr

    # Sent back in each way, they are in the same study, once.
    run(data, *look, '--compress', 'rle', '-o', 'still.dcm', '--send', dimse)
    run(*ways['wado'], *look, '--view', 'left', '-o', 'left.dcm', '--send', web)
    run(data, *look, '--rotation', '3', '-o', 'turn.dcm', '--write-state', 'state.dcm', '--send', dimse)
    assert pacs.instances() == len(slices) + 4
    run(data, *look, '--rotation', '3', '-o', 'turn.dcm', '--write-state', 'state.dcm', '--send', dimse, '--force')
    assert pacs.instances() == len(slices) + 4, 'sent twice, stored twice'
    assert len(pacs.json('/studies')) == 1 and len(pacs.json('/patients')) == 1
    found = {s['0020000E']['Value'][0]: s for s in pacs.json('/dicom-web/studies/%s/series' % study)}
    for name in ('still', 'left', 'turn', 'state'):
        mine = pydicom.dcmread(name + '.dcm')
        assert mine.SeriesInstanceUID in found, name
        where = '/dicom-web/studies/%s/series/%s/instances' % (study, mine.SeriesInstanceUID)
        views = ('still', 'left') # of one preset: one series
        there = {pydicom.dcmread(n + '.dcm').SOPInstanceUID for n in (views if name in views else (name,))}
        assert {i['00080018']['Value'][0] for i in pacs.json(where)} == there, name
        if name in ('still', 'left'):
            preview = pacs.get('%s/%s/rendered' % (where, mine.SOPInstanceUID), 'image/png')
            assert preview[:8] == b'\x89PNG\r\n\x1a\n', name
            open(name + '-preview.png', 'wb').write(preview)
            assert run.__self__.compare(name + '-preview.png', name + '.dcm'), name + ': another preview'

    # Study wide the captures are there too, and the picture is still the series'.
    run(*ways['study'], *look, '-o', 'again.png')
    assert open('again.png', 'rb').read() == truth

    # The PACS dies in mid-transfer and returns while ctsplat retries.
    def die():
        pacs.kill()
        pacs.start()

    before = pacs.instances()
    proxy = peers.Proxy(pacs.dicom, 400000, die)
    run(data, '--size', '600x600', '--view', 'head', '-o', 'head.dcm', '--send',
        'ORTHANC@127.0.0.1:%d' % proxy.port)
    assert proxy.connections >= 2 and pacs.instances() == before + 1
    proxy = peers.Proxy(pacs.http, 400000, die)
    run(data, '--size', '600x600', '--view', 'feet', '-o', 'feet.dcm', '--send',
        'http://127.0.0.1:%d/dicom-web' % proxy.port)
    assert proxy.connections >= 2 and pacs.instances() == before + 2

    # Interrupted in mid-fetch: nothing is left.
    slow = peers.Proxy(pacs.dicom, None, None, pause=0.2)
    run('--from', 'ORTHANC@127.0.0.1:%d' % slow.port, '--study-uid', study, '--series-uid', series, '-o', 'no.png',
        code=130, interrupt_after=2)
    assert not os.path.exists('no.png')

    # Killed in mid-fetch, it leaves a folder, which the next fetch removes; one in use is kept.
    def begin_fetch():
        known = os.listdir('tmp')
        begun = subprocess.Popen([ctsplat, 'render', '--from', 'ORTHANC@127.0.0.1:%d' % slow.port, '--study-uid', study,
                                  '-o', 'no.png'], env=dict(os.environ, TMPDIR=os.path.abspath('tmp')))
        while not set(os.listdir('tmp')) - set(known):
            assert begun.poll() is None
            time.sleep(0.01)
        return begun, (set(os.listdir('tmp')) - set(known)).pop()

    killed, old = begin_fetch()
    killed.kill()
    killed.wait()
    at_work, used = begin_fetch()
    assert used != old and os.listdir('tmp') == [used], (old, used, os.listdir('tmp'))
    at_work.terminate()
    assert at_work.wait() == 130 and not os.listdir('tmp')

    # A peer that refuses or stays down: the file is kept, and the message says how to send it.
    said = run(data, *look, '-o', 'refused.dcm', '--send', 'NOBODY@127.0.0.1:%d' % pacs.dicom, code=5)
    assert 'refused.dcm' in said and 'dcmsend' in said and os.path.exists('refused.dcm'), said
    pacs.kill()
    for peer, words in ((dimse, 'dcmsend'), (web, '--force')):
        said = run(data, *look, '-o', 'kept.dcm', '--force', '--send', peer, code=5)
        assert words in said and said.count('\n') == 1, said
        pydicom.dcmread('kept.dcm').pixel_array
    for way in ways.values():
        run(*way, *look, '-o', 'none.png', code=3)
        assert not os.path.exists('none.png')
finally:
    pacs.kill()
