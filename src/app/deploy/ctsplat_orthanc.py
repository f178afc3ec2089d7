"""Pictures of volumes in Orthanc, made by `ctsplat serve`: PS3.18 rendered3D and thumbnails below /dicom-web, and
previews that are made when a series is stable; and folders of stable series for `ctsplat batch`. Nothing is rendered inside
Orthanc.

Orthanc's configuration, with the Python plugin:

    "PythonScript": "/usr/share/ctsplat/ctsplat_orthanc.py",
    "Ctsplat": {
      "Server": "unix:/run/ctsplat/serve.sock",
      "TokenFile": "",
      "Folder": "/var/lib/ctsplat-orthanc",
      "Previews": true,
      "Batch": false
    }

Server: the socket or the address of `ctsplat serve 'FOLDER/{series_uid}'`; TokenFile: where it is an address. Both programs
must see Folder. Batch: each stable series of CT is put there, and Folder/.stable touched. A slice is a link there to the file that Orthanc stores, where that is as it came and can be read; else a
copy."""
import http.client
import json
import os
import re
import shutil
import socket
import stat
import tempfile
import threading
import time
import urllib.parse

import orthanc

SETTINGS = {'Server': 'unix:/run/ctsplat/serve.sock', 'TokenFile': '', 'Folder': '/var/lib/ctsplat-orthanc',
            'Previews': True, 'Batch': False}
CONFIGURATION = json.loads(orthanc.GetConfiguration())
SETTINGS.update(CONFIGURATION.get('Ctsplat', {}))
STORAGE = CONFIGURATION.get('StorageDirectory', 'OrthancStorage')
ROOT = '/' + CONFIGURATION.get('DicomWeb', {}).get('Root', '/dicom-web/').strip('/')
CT = ('CT',)
lock = threading.Lock()
SETTLED_S = 3  # after which `batch --settled 1` takes what came, a second for each one that is begun


class Refused(Exception):
    """An answer that is no picture: status and one line."""


class LocalConnection(http.client.HTTPConnection):
    """HTTP over a socket in a folder."""

    def __init__(self, path):
        super().__init__('localhost', timeout=600)
        self.path = path

    def connect(self):
        self.sock = socket.socket(socket.AF_UNIX)
        self.sock.settimeout(self.timeout)
        self.sock.connect(self.path)


def connection():
    server = SETTINGS['Server']
    if server.startswith('unix:'):
        return LocalConnection(server[len('unix:'):]), '', {}
    url = urllib.parse.urlsplit(server)
    kind = http.client.HTTPSConnection if url.scheme == 'https' else http.client.HTTPConnection
    with open(SETTINGS['TokenFile'], encoding='ascii') as f:
        token = f.read().strip()
    return kind(url.hostname, url.port, timeout=600), url.path.rstrip('/'), {'Authorization': 'Bearer ' + token}


def ask(path, accept=None):
    """Status, headers and body of what the server answers."""
    link, root, headers = connection()
    try:
        link.request('GET', root + path, headers={**headers, **({'Accept': accept} if accept else {})})
        answer = link.getresponse()
        return answer.status, dict(answer.headers), answer.read()
    except OSError as e:
        raise Refused(503, f'ctsplat serve does not answer: {e.strerror or type(e).__name__}') from None
    finally:
        link.close()


def api(path):
    return json.loads(orthanc.RestApiGet(path))


def resource_of(lookup, uid):
    """Orthanc's own name of a series or study, or None."""
    try:
        return lookup(uid)
    except orthanc.OrthancException:
        return None


def stored_file(instance):
    """The path of an instance in Orthanc's storage, or None where it is compressed, elsewhere, or not readable by
    others."""
    try:
        attachment = api(f'/instances/{instance}/attachments/dicom/info')
        uuid = attachment['Uuid']
        path = os.path.realpath(os.path.join(STORAGE, uuid[0:2], uuid[2:4], uuid))
        status = os.stat(path)
        plain = attachment['CompressedSize'] == attachment['UncompressedSize'] == status.st_size
        return path if plain and status.st_mode & (stat.S_IRGRP | stat.S_IROTH) else None
    except (OSError, KeyError, orthanc.OrthancException):
        return None


def place(series_uid):
    """Puts the slices of a series where the server finds them."""
    resource = resource_of(orthanc.LookupSeries, series_uid)
    if not resource:
        raise Refused(404, 'there is no such series here')
    series = api('/series/' + resource)
    if series['MainDicomTags'].get('Modality') not in CT:
        raise Refused(400, 'the series is no CT')
    if not series['IsStable']:
        raise Refused(503, 'the series is still coming in')
    folder = os.path.join(SETTINGS['Folder'], series_uid)
    with lock:
        if os.path.isdir(folder) and sorted(os.listdir(folder)) == sorted(series['Instances']):
            return
        new = tempfile.mkdtemp(dir=SETTINGS['Folder'], prefix='.new-')
        os.chmod(new, 0o750)
        for instance in series['Instances']:
            name, stored = os.path.join(new, instance), stored_file(instance)
            if stored:
                os.symlink(stored, name)
            else:
                with open(name, 'wb') as f:
                    f.write(orthanc.RestApiGet(f'/instances/{instance}/file'))
        shutil.rmtree(folder, ignore_errors=True)
        os.rename(new, folder)


def place_state(series_uid, instance_uid):
    """Puts a presentation state, and the slices of the series that it is of, where the server finds them."""
    instance = resource_of(orthanc.LookupInstance, instance_uid)
    if not instance:
        raise Refused(404, 'there is no such object here')
    with lock, tempfile.TemporaryDirectory(dir=SETTINGS['Folder'], prefix='.new-') as new:
        name, folder = os.path.join(new, instance_uid + '.dcm'), os.path.join(SETTINGS['Folder'], series_uid)
        with open(name, 'wb') as f:
            f.write(orthanc.RestApiGet(f'/instances/{instance}/file'))
        os.makedirs(folder, mode=0o750, exist_ok=True)
        os.rename(name, os.path.join(folder, instance_uid + '.dcm'))
    for series in api(f'/instances/{instance}/simplified-tags').get('ReferencedSeriesSequence', [])[:1]:
        place(series['SeriesInstanceUID'])


def clear_away():
    """Series that Orthanc has no more."""
    with lock:
        for name in os.listdir(SETTINGS['Folder']):
            if name.startswith('.new-') or not resource_of(orthanc.LookupSeries, name):
                shutil.rmtree(os.path.join(SETTINGS['Folder'], name), ignore_errors=True)


def modality(series_uid):
    resource = resource_of(orthanc.LookupSeries, series_uid)
    return api('/series/' + resource)['MainDicomTags'].get('Modality') if resource else None


def place_all(study_uid, series_uid, instance_uid):
    """The series of a request, or the one CT series of its study, or a presentation state with its series."""
    if instance_uid and modality(series_uid) == 'PR':
        place_state(series_uid, instance_uid)
        return series_uid
    if series_uid:
        place(series_uid)
        return series_uid
    study = resource_of(orthanc.LookupStudy, study_uid)
    series = [api('/series/' + s) for s in api('/studies/' + study)['Series']] if study else []
    found = [s['MainDicomTags']['SeriesInstanceUID'] for s in series if s['MainDicomTags'].get('Modality') in CT]
    if len(found) != 1:
        raise Refused(404 if not found else 400, f'the study has {len(found)} series of CT (ask for one of them)')
    place(found[0])
    return found[0]


def answer(output, status, headers, body):
    if status == 200:
        output.AnswerBuffer(body, headers.get('Content-Type', 'application/octet-stream'))
    else:
        if 'Retry-After' in headers or status == 503:
            output.SetHttpHeader('Retry-After', headers.get('Retry-After', '1'))
        try:
            output.SendHttpStatus(status, body.decode(), len(body))
        except TypeError:  # without the length from version 5 of the Python plug-in on
            output.SendHttpStatus(status, body.decode())


def refuse(output, refused):
    status, text = refused.args
    answer(output, status, {}, (text + '\n').encode())


def rendered(output, uri, **request):
    """GET ROOT/studies/S[/series/E[/instances/I]]/rendered3D or thumbnail."""
    if request['method'] != 'GET':
        output.SendMethodNotAllowed('GET')
        return
    study_uid, series_uid, instance_uid = (list(request['groups'])[:-1] + [None, None])[:3]
    query = urllib.parse.urlencode(request['get'])
    try:
        series_uid = place_all(study_uid, series_uid, instance_uid)
        path = f'/studies/{study_uid}/series/{series_uid}'
        if instance_uid:
            path += f'/instances/{instance_uid}'
        answer(output, *ask(f"{path}/{request['groups'][-1]}?{query}", request['headers'].get('accept')))
    except Refused as refused:
        refuse(output, refused)


def preview(resource):
    """A small picture of a series, as status, headers and body."""
    tags = api('/series/' + resource)['MainDicomTags']
    study = api(f'/series/{resource}/study')['MainDicomTags']['StudyInstanceUID']
    uid = tags['SeriesInstanceUID']
    place(uid)
    return ask(f'/studies/{study}/series/{uid}/thumbnail')


def thumbnail(output, uri, **request):
    """GET /series/ID/thumbnail."""
    try:
        answer(output, *preview(request['groups'][0]))
    except Refused as refused:
        refuse(output, refused)
    except orthanc.OrthancException:
        refuse(output, Refused(404, 'there is no such series here'))


def make_preview(resource):
    """The server keeps it."""
    try:
        preview(resource)
    except (Refused, orthanc.OrthancException):
        pass  # no volume, or deleted meanwhile; a client that requests its thumbnail gets the reason


def hand_over(resource):
    """Puts a series where `ctsplat batch` finds it, and wakes ctsplat-batch.path."""
    try:
        place(api('/series/' + resource)['MainDicomTags']['SeriesInstanceUID'])
        time.sleep(SETTLED_S)
        with open(os.path.join(SETTINGS['Folder'], '.stable'), 'a', encoding='ascii'):
            os.utime(os.path.join(SETTINGS['Folder'], '.stable'))
    except (Refused, orthanc.OrthancException, KeyError):
        pass  # no CT, or deleted meanwhile


def changed(change, level, resource):
    if change == orthanc.ChangeType.STABLE_SERIES:
        for setting, do in ('Previews', make_preview), ('Batch', hand_over):
            if SETTINGS[setting]:
                threading.Thread(target=do, args=[resource], daemon=True).start()
    elif change == orthanc.ChangeType.DELETED and level == orthanc.ResourceType.SERIES:
        threading.Thread(target=clear_away, daemon=True).start()


os.makedirs(SETTINGS['Folder'], mode=0o750, exist_ok=True)
UID = '([0-9.]+)'
for below in '', f'/series/{UID}', f'/series/{UID}/instances/{UID}':
    orthanc.RegisterRestCallback(f'{re.escape(ROOT)}/studies/{UID}{below}/(rendered3D|thumbnail)', rendered)
orthanc.RegisterRestCallback('/series/([0-9a-f-]+)/thumbnail', thumbnail)
orthanc.RegisterOnChangeCallback(changed)
