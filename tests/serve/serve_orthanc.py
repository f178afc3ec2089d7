#!/usr/bin/env python3
"""Pictures through Orthanc: serve_orthanc.py CTSPLAT LOOPBACK_SO DATA"""
import glob
import json
import os
import subprocess
import sys
import time
import urllib.error
import urllib.request

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, '..', 'net'))
import peers  # noqa: E402
from server import Server  # noqa: E402

ctsplat, loopback, data = sys.argv[1:]
peers.need('Orthanc')
if not glob.glob('/usr/share/orthanc/plugins/*Python*') + glob.glob('/usr/lib/orthanc/plugins/*Python*'):
    peers.skip("no Python plugin of Orthanc's")
import pydicom  # noqa: E402

SCRIPT = os.path.join(HERE, '..', '..', 'src', 'app', 'deploy', 'ctsplat_orthanc.py')


def refused(pacs, path):
    try:
        pacs.get(path)
    except urllib.error.HTTPError as e:
        return e.code
    raise AssertionError(path)


def look_at(pacs, server, study, series, resource):
    base = f'/dicom-web/studies/{study}/series/{series}/rendered3D?viewport=64,48'
    for query, accept in [('', 'image/png'), ('&orientation=l&preset=skin', 'image/png'), ('', 'image/jpeg')]:
        assert pacs.get(base + query, accept) == server.get(base.replace('/dicom-web', '') + query, {'Accept': accept})
    assert pacs.get(base.replace(f'/series/{series}', ''), 'image/png') == pacs.get(base, 'image/png')
    # Example B.32, and what is not supported.
    module = json.loads(pacs.get(base + '&renderingmethod=volume_rendered&orientation=a&swivelrange=180&animationrate=20'
                                 '&renderedvolumetricmetadata=yes', 'application/dicom+json'))
    assert module['0070120D']['Value'] == ['VOLUME_RENDERED'] and module['00701A06']['Value'] == [180], module
    assert refused(pacs, base + '&match=x') == 400
    assert refused(pacs, base.replace(series, '1.2.3')) == 404
    # The functions of the DICOMweb plug-in still work.
    assert pacs.json(f'/dicom-web/studies/{study}/series')[0]['0020000E']['Value'] == [series]
    small = pacs.get(base.replace('rendered3D?viewport=64,48', 'thumbnail'))
    assert small == server.get(base.replace('/dicom-web', '').replace('rendered3D?viewport=64,48', 'thumbnail'))
    assert pacs.get(f'/series/{resource}/thumbnail') == small and small[:3] == b'\xff\xd8\xff'


def state(pacs, study):
    """Example B.35: a presentation state of ours that Orthanc has."""
    words = ['--preset', 'skin', '--view', '-30,20', '--size', '64x48', '--png-bits', '8', '-o', 'state.png']
    subprocess.run([ctsplat, 'render', data, *words, '--write-state', 'state.dcm'], check=True, capture_output=True)
    pacs.put('state.dcm')
    made = pydicom.dcmread('state.dcm')
    path = f'/dicom-web/studies/{study}/series/{made.SeriesInstanceUID}/instances/{made.SOPInstanceUID}/rendered3D'
    with open('state.png', 'rb') as f:
        assert pacs.get(path, 'image/png') == f.read()
    assert pacs.get(path + '?orientation=l&viewport=32,24', 'image/jpeg')[:3] == b'\xff\xd8\xff'
    assert refused(pacs, path + '?preset=bone') == 400
    assert refused(pacs, path.replace(made.SOPInstanceUID, '1.2.3')) == 404


def fetched(pacs, other, study, series):
    """A series known only to a peer is fetched at the first request, and stays loaded."""
    path = f'/studies/{study}/series/{series}/rendered3D?viewport=64,48&accept=image/png'
    with Server(ctsplat, '--from', pacs.url + '/dicom-web') as server:
        assert server.series() == []
        server.refused(404, 'no such series', path.replace(series, '1.2.3'))
        assert server.get(path) == other.get(path) == server.get(path)
        assert [s['dims'] for s in server.series()] == [[64, 64, 48]]
        assert server.get(f'/series/{server.series()[0]["id"]}/picture.png?size=64x48') == other.get(path)


folder = os.path.abspath('slices')
slices = sorted(glob.glob(os.path.join(data, '*.dcm')))
source = pydicom.dcmread(slices[0], stop_before_pixels=True)
os.makedirs(folder)
with Server(ctsplat, folder + '/{series_uid}') as whole:
    with open('token', 'w') as f:
        f.write(whole.token + '\n')
    address = {'Server': whole.url.split('?')[0], 'TokenFile': os.path.abspath('token'), 'Folder': folder}
    archive = peers.Orthanc(os.path.abspath('pacs'), loopback, more={'PythonScript': SCRIPT, 'Ctsplat': address,
                                                                     'StableAge': 1})
    try:
        for path in slices:
            archive.put(path)
        name = archive.json('/series')[0]
        # The preview is made by itself.
        end = time.monotonic() + 200
        while not glob.glob(os.path.expanduser('~/.cache/ctsplat/thumbnails/*.jpg')):
            assert time.monotonic() < end, open('pacs.log').read()[-2000:]
            time.sleep(0.1)
        look_at(archive, whole, source.StudyInstanceUID, source.SeriesInstanceUID, name)
        state(archive, source.StudyInstanceUID)
        fetched(archive, whole, source.StudyInstanceUID, source.SeriesInstanceUID)
        placed = os.path.join(folder, source.SeriesInstanceUID)
        assert all(os.path.islink(os.path.join(placed, f)) for f in os.listdir(placed)) and len(os.listdir(placed)) == 48
        urllib.request.urlopen(urllib.request.Request(f'{archive.url}/series/{name}', method='DELETE'), timeout=120)
        while os.path.isdir(placed):
            assert time.monotonic() < end, 'the folder of a series that is gone stays'
            time.sleep(0.1)
    finally:
        archive.kill()
