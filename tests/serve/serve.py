#!/usr/bin/env python3
"""ctsplat serve from end to end: serve.py CTSPLAT LOOPBACK_SO DATA"""
import http.client
import json
import os
import random
import shutil
import signal
import socket
import ssl
import subprocess
import sys
import threading
import time
import xml.etree.ElementTree
from concurrent.futures import ThreadPoolExecutor

import pydicom
from server import Server

ctsplat, _, data = sys.argv[1:]
soak = bool(os.environ.get('CTS_SOAK'))
SMALL = 'size=64x48'


def render(*options):
    """The program's own bytes."""
    out = f'own.{options[0]}'
    subprocess.run([ctsplat, 'render', data, '-o', out, '--force', *options[1:]], check=True, capture_output=True)
    with open(out, 'rb') as f:
        return f.read()


def equal_bytes(server, series):
    """The same bytes as `render` writes, in any order and number of requests."""
    asked = [('png', 'preset=skin&view=left', '--preset skin --view left --png-bits 8'),
             ('png', 'preset=skin&view=left&png-bits=16', '--preset skin --view left'),
             ('png', 'preset=skin&view=left&occlusion=0', '--preset skin --view left --occlusion 0 --png-bits 8'),
             ('png', 'preset=skin&view=left&ambient-occlusion=0.8', '--preset skin --view left --occlusion 0.8 --png-bits 8'),
             ('png', 'view=-30,20&max-error=8', '--view -30,20 --max-error 8 --png-bits 8'),
             ('png', 'mode=mip', '--mode mip --png-bits 8'),
             ('png', 'centre=5,6,7&mm-per-pixel=2', '--centre 5,6,7 --mm-per-pixel 2 --png-bits 8'),
             ('png', 'centre=5,6,7', '--centre 5,6,7 --png-bits 8'),
             ('png', 'remove-table=off&crop=-50,50,-50,50,-50,50&background=%23ffffff',
              '--remove-table off --crop -50,50,-50,50,-50,50 --background #ffffff --png-bits 8'),
             ('webp', 'swivel=40,20&frame-rate=7', '--swivel 40,20 --frame-rate 7'),
             ('jpg', 'annotate=orientation&quality=50', '--annotate orientation --quality 50')]
    own = [render(ending, '--size', '64x48', *words.split()) for ending, _, words in asked]
    paths = [f'/series/{series}/picture.{ending}?{SMALL}&{query}' for ending, query, _ in asked]
    with ThreadPoolExecutor(8) as pool:
        for k, body in enumerate(pool.map(server.get, paths * 3)):
            assert body == own[k % len(own)], paths[k % len(own)]
    assert own[6] != own[7], 'the scale is another'


def warned(server, series):
    """A warning about a picture is sent with each request, also for a cached renderer."""
    for view in 'left', 'left', 'head':
        scene = json.loads(server.ask(f'/series/{series}/picture.png?{SMALL}&preset=vessel&view={view}')[1]['Ctsplat-Scene'])
        assert sum('no contrast agent' in text for text in scene['warnings']) == 1, scene


def words(server, series):
    """Errors are reported; options that name files are refused."""
    picture = f'/series/{series}/picture.png?'
    for text, query in [('`size` x', 'size=x'), ('preset /etc/passwd', 'preset=/etc/passwd'), ('no such preset', 'preset=x'),
                        ('path: no such option', 'path=/'), ('output: no such', 'output=/tmp/x'), ('key: no', 'key=/etc/x'),
                        ('labels: no such', 'labels=/etc'), ('state: no such', 'state=/etc/passwd'),
                        ('log: no such', 'log=-'), ('from: no such', 'from=x'), ('send: no such', 'send=x'),
                        ('threads: no such', 'threads=9'), ('one .png holds one', 'rotation=4'),
                        ('`swivel`: `rotation`', 'swivel=40,20&rotation=3'), ('`swivel` 20,40', 'swivel=20,40'),
                        ('not X,Y,Z', 'centre=1,2'), ('more than 64', '&'.join(['size=8x8'] * 70))]:
        server.refused(400, text, picture + query)
    server.refused(400, r'^a \.webp has at most 16383', f'/series/{series}/picture.webp?size=17000x8')
    server.refused(404, 'no such series', '/series/0123456789abcdef/picture.png')
    server.refused(404, 'format', f'/series/{series}/picture.bmp')
    server.refused(404, 'no such address', '/nothing')
    shades = {p['name']: p['shade'] for p in json.loads(server.get('/presets'))}
    assert shades['bone'] == {'occlusion': 0.45} and shades['ct-bone'] == {'occlusion': 0} and shades['bone-window'] is None, shades


def guarded(server, series):
    """Token, Host, methods."""
    for path in '/', '/series', f'/series/{series}/picture.png', '/list.js':
        server.refused(401, 'token', path, token=False)
        server.refused(401, 'token', path, headers={'Authorization': 'Bearer ' + server.token[:-1]})
        server.refused(401, 'token', path, token=False, headers={'Cookie': 'ctsplat=' + 'x' * 32})
    status, headers, _ = server.ask('/?token=' + server.token, token=False)
    cookie = headers['Set-Cookie'].split(';')[0]
    assert status == 303 and headers['Location'] == './' and 'HttpOnly; SameSite=Strict' in headers['Set-Cookie']
    assert server.ask('/', token=False, headers={'Cookie': 'other=1; ' + cookie})[0] == 200
    for host in 'evil.example', 'evil.example:80', 'localhost.evil.example', '', '127.0.0.1.evil.example':
        server.refused(400, 'Host', '/series', headers={'Host': host})
    for host in 'localhost', 'localhost:99', '[::1]:8484', '10.1.2.3', 'known.example':
        assert server.ask('/series', headers={'Host': host})[0] == 200, host
    for method in 'POST', 'PUT', 'DELETE', 'OPTIONS', 'FROBNICATE':
        server.refused(405, 'GET', '/series', method=method)
    assert 'Access-Control-Allow-Origin' not in server.ask('/series', headers={'Origin': 'http://a.example'})[1]
    assert server.ask('/series', method='HEAD')[2] == b''
    for more in {'Content-Length': '9'}, {'Transfer-Encoding': 'chunked'}:
        assert server.refused(413, 'has none', '/series', headers=more)['Connection'] == 'close'


def rendered(server, study, uid):
    """PS3.18 rendered3D."""
    base = f'/studies/{study}/series/{uid}/rendered3D?viewport=64,48'
    status, headers, body = server.ask(base)
    assert status == 200 and headers['Content-Type'] == 'image/jpeg' and body[:3] == b'\xff\xd8\xff'
    png = {'Accept': 'text/html, image/png;q=0.8, image/jpeg;q=0.1'}
    assert server.get(base, png) == render('png', '--size', '64x48', '--png-bits', '8')
    assert server.get(base + '&accept=image/png&orientation=l') == \
        render('png', '--size', '64x48', '--png-bits', '8', '--view', 'left')
    assert server.get(f'/studies/{study}/rendered3D?viewport=64,48', png) == server.get(base, png)
    # The standard's window has centre and width; its head has the front at the top.
    assert server.get(base + '&renderingmethod=maximum_ip&window=50,400,linear-exact', png) == \
        render('png', '--size', '64x48', '--png-bits', '8', '--mode', 'mip', '--window', '-150,250')
    assert server.get(base + '&orientation=h', png) == \
        render('png', '--size', '64x48', '--png-bits', '8', '--view', '180,90')
    with open('got.dcm', 'wb') as f:
        f.write(server.get(base, {'Accept': 'application/dicom'}))
    assert pydicom.dcmread('got.dcm').StudyInstanceUID == study
    # Example B.32: what the server chose, as a camera that gives the same picture.
    module = json.loads(server.get(base + '&renderingmethod=volume_rendered&orientation=a&swivelrange=180&animationrate=20'
                                   '&renderedvolumetricmetadata=yes', {'Accept': 'application/dicom+json'}))
    value = {tag: v['Value'] for tag, v in module.items()}
    assert value['00720510'] == ['3D_RENDERING'] and value['0070120D'] == ['VOLUME_RENDERED']
    assert value['00701A06'] == [180] and value['00701A05'] == [5] and value['00701A03'] == [20]
    assert value['00701605'] == [0, 0, 1] and value['00701603'][1] < value['00701604'][1], value
    module = json.loads(server.get(base + '&orientation=r&renderedvolumetricmetadata=yes'))
    camera = '&'.join(f'{name}={",".join(map(str, module[tag]["Value"]))}' for name, tag in
                      [('viewpointposition', '00701603'), ('viewpointlookat', '00701604'), ('viewpointup', '00701605')])
    assert server.get(f'{base}&{camera}', png) == server.get(base + '&orientation=r', png)
    swivel = server.get(base + '&swivelrange=40&animationstepsize=20&accept=image/*')
    assert swivel[:4] == b'RIFF' and swivel.count(b'ANMF') == 4
    for text, query in [('volumeinputreference: not', 'volumeinputreference=1.2'), ('match: not', 'match=x'),
                        ('volumetriccurvepoint: not', 'volumetriccurvepoint=1,2,3'), ('renderingmethod x', 'renderingmethod=x'),
                        ('orientation q', 'orientation=q'), ('one or the other', 'orientation=a&viewpointup=0,0,1'),
                        ('given together', 'viewpointposition=1,2,3'), ('roll', camera.replace('up=0,0,1', 'up=0,1,1')),
                        ('CENTRE,WIDTH', 'window=50,400'), ('CENTRE,WIDTH', 'window=50,400,sigmoid'),
                        ('given twice', 'viewport=9,9'), ('need swivelrange', 'animationrate=5'), ('not yes',
                        'renderedvolumetricmetadata=no'), ('mprslab: belongs', 'mprslab=3'), ('frob: no such', 'frob=1')]:
        server.refused(400, text, f'{base}&{query}')
    server.refused(406, 'image/jpeg', base, headers={'Accept': 'video/mpeg'})
    server.refused(406, 'image/jpeg', base + '&swivelrange=40', headers={'Accept': 'image/jpeg'})
    for path in f'/studies/{study}/series/{uid}/renderedMPR', f'/studies/{study}', f'/studies/{study}/series/1.2/rendered3D', \
            f'/studies/1.2/series/{uid}/rendered3D', '/studies/1.2/rendered3D', '/studies//series//rendered3D':
        server.refused(404, '.', path)


def states(study, uid, slices):
    """Example B.35: a presentation state of our own; others, and single slices, are refused."""
    shutil.copytree(data, 'archive')
    subprocess.run([ctsplat, 'render', data, '--preset', 'skin', '--view', '-30,20', '--size', '64x48', '--png-bits', '8',
                    '-o', 'state.png', '--write-state', 'archive/state.dcm'], check=True, capture_output=True)
    state = pydicom.dcmread('archive/state.dcm')
    base = f'/studies/{study}/series/{state.SeriesInstanceUID}/instances/{state.SOPInstanceUID}/rendered3D'
    stranger = pydicom.dcmread('archive/state.dcm')
    stranger.SOPInstanceUID = stranger.file_meta.MediaStorageSOPInstanceUID = '1.2.3.4'
    for element in [e.tag for e in stranger if e.tag.is_private]:
        del stranger[element]
    stranger.save_as('archive/stranger.dcm')
    other = pydicom.dcmread('archive/state.dcm')
    other.SOPInstanceUID = other.file_meta.MediaStorageSOPInstanceUID = '1.2.3.5'
    other.VolumetricPresentationInputSetSequence[0].ReferencedImageSequence[0].ReferencedSOPInstanceUID = '1.2.3.6'
    other.save_as('archive/other.dcm')
    with Server(ctsplat, 'archive') as server:
        png = {'Accept': 'image/png'}
        with open('state.png', 'rb') as f:
            assert server.get(base, png) == f.read()
        assert server.get(base + '?orientation=l', png) == \
            render('png', '--preset', 'skin', '--view', 'left', '--size', '64x48', '--png-bits', '8')
        server.refused(400, 'preset: cannot be combined', base + '?preset=bone')
        server.refused(400, 'cannot be combined', base + '?renderedvolumetricmetadata=yes')
        server.refused(400, '^[^/]*private attributes', base.replace(state.SOPInstanceUID, '1.2.3.4'))
        server.refused(404, 'volume of the presentation state', base.replace(state.SOPInstanceUID, '1.2.3.5'))
        one = f'/studies/{study}/series/{uid}/instances/%s/rendered3D'
        server.refused(400, '1 of the 48 slices', one % slices)
        server.refused(404, 'no such object', one % '1.2.3')
        server.refused(404, 'no such series', base.replace(study, '1.2.3'))
    os.makedirs(f'all/of-{uid}')
    stranger.save_as(f'all/of-{uid}/1.2.3.4.dcm')
    with Server(ctsplat, 'all/of-{series_uid}') as server:
        server.refused(400, '^[^/]*private attributes', one % '1.2.3.4')


def thumbnails(study, uid):
    """A series as `render` shows it, an object by itself; kept on the disk, until the files are others."""
    shutil.copytree(data, 'small')
    files = sorted(os.listdir('small'))
    sops = [pydicom.dcmread(f'small/{name}', stop_before_pixels=True).SOPInstanceUID for name in files]
    named = pydicom.dcmread(f'small/{files[0]}')
    named.SOPClassUID = named.file_meta.MediaStorageSOPClassUID = '1.2.840.10008.5.1.4.1.1.7'
    named.SeriesInstanceUID, named.SOPInstanceUID, named.BurnedInAnnotation = '1.2.9', '1.2.9.1', 'YES'
    named.save_as('small/named.dcm')
    os.makedirs('small/broken')
    for name in files[:9] + files[13:22]:
        with open(f'small/{name}', 'rb') as f, open(f'small/broken/{name}', 'wb') as to:
            to.write(f.read().replace(uid.encode(), uid[:-1].encode() + (b'1' if uid[-1] == '0' else b'0')))
    broken = pydicom.dcmread(f'small/broken/{files[0]}', stop_before_pixels=True).SeriesInstanceUID
    series = f'/studies/{study}/series/{uid}'
    kept = os.path.expanduser('~/.cache/ctsplat/thumbnails')
    own = {ending: render(ending, '--size', '256x256', '--png-bits', '8') for ending in ('jpg', 'png', 'webp')}
    with Server(ctsplat, 'small') as server:
        tags = set()
        for path in f'/studies/{study}/thumbnail', f'{series}/thumbnail', f'/series/{server.series()[0]["id"]}/thumbnail':
            for accept, ending in ('*/*', 'jpg'), ('image/png', 'png'), ('image/webp, image/png;q=0.1', 'webp'), ('', 'jpg'):
                status, headers, body = server.ask(path, {'Accept': accept})
                tags.add(headers['ETag'])
                assert body == own[ending], (path, accept)
                status, same, empty = server.ask(path, {'Accept': accept, 'If-None-Match': f'"x", {headers["ETag"]}'})
                assert (status, empty, same['ETag']) == (304, b'', headers['ETag'])
                assert headers['Cache-Control'] == 'private, no-cache' and 'no-store' not in same['Cache-Control']
        assert len(tags) == 3 == len(os.listdir(kept)) and os.stat(kept).st_mode & 0o777 == 0o700, os.listdir(kept)
        assert server.get(f'{series}/thumbnail?viewport=64,48&accept=image/png') == render('png', '--size', '64x48', '--png-bits', '8')
        slices = {server.get(f'{series}/instances/{sops[k]}/thumbnail', {'Accept': 'image/png'}) for k in (0, 24, 30)}
        assert len(slices) == 3 and all(png[16:24] == bytes([0, 0, 0, 64] * 2) for png in slices), 'each is its own, not enlarged'
        one = server.get(f'{series}/instances/{sops[24]}/thumbnail?viewport=40,20&accept=image/png')
        assert one[16:24] == bytes([0, 0, 0, 20] * 2), one[:24]
        for text, query in [('a part', 'viewport=9,9,1,1'), ('not WIDTH,HEIGHT', 'viewport=9'), ('`size` 0x9', 'viewport=0,9'),
                            ('`size` 9.5x9', 'viewport=9.5,9'), ('at most 1024', 'viewport=1025,9'),
                            ('given twice', 'viewport=9,9&viewport=9,9'), ('viewport, accept and charset', 'preset=bone')]:
            server.refused(400, text, f'{series}/thumbnail?{query}')
        server.refused(406, 'image/jpeg, image/png and image/webp$', f'{series}/thumbnail', headers={'Accept': 'application/dicom'})
        server.refused(404, "patient's name", f'/studies/{study}/series/1.2.9/thumbnail')
        server.refused(404, "patient's name", f'/studies/{study}/series/1.2.9/instances/1.2.9.1/thumbnail')
        server.refused(404, 'missing', f'/studies/{study}/series/{broken}/thumbnail')
        for path in '/studies/1.2/thumbnail', f'{series}1/thumbnail', f'{series}/instances/1.2/thumbnail', \
                f'{series}/instances/1.2.9.1/thumbnail', f'{series}/thumbnail/thumbnail':
            server.refused(404, '.', path)
        server.refused(401, 'token', f'{series}/thumbnail', token=False)
        # A client that goes away, and a file that is another one since: what is kept stays, and no picture of both.
        with socket.create_connection((server.host, server.port)) as s:
            s.sendall(f'GET {series}/thumbnail?viewport=999,999 HTTP/1.1\r\nHost: localhost\r\n'
                      f'Authorization: Bearer {server.token}\r\n\r\n'.encode())
        shutil.copy(f'small/{files[30]}', f'small/{files[24]}')
        status, _, body = server.ask(f'{series}/instances/{sops[24]}/thumbnail?viewport=41,41')
        assert status == 500 and b'changed' in body and b'small' not in body, body
        assert server.get(f'{series}/instances/{sops[24]}/thumbnail?viewport=40,20&accept=image/png') == one
        n_kept = len(os.listdir(kept))
    shutil.copy(os.path.join(data, files[24]), 'small')
    os.utime(os.path.join(kept, os.listdir(kept)[0]), (0, 0))
    with Server(ctsplat, 'small', '--show-patient') as server:
        assert server.ask(f'{series}/thumbnail')[1]['ETag'] not in tags and len(os.listdir(kept)) == n_kept, 'other files, and an old one less'
        assert server.get(f'/studies/{study}/series/1.2.9/thumbnail')[:3] == b'\xff\xd8\xff'
    shutil.rmtree(kept)
    with open(kept, 'w'):
        pass
    with Server(ctsplat, 'small') as server:
        assert server.get(f'{series}/thumbnail') == server.get(f'{series}/thumbnail') and 'not kept' in server.stderr()
    os.remove(kept)
    os.makedirs('each')
    os.rename('small', f'each/{uid}')
    with Server(ctsplat, 'each/{series_uid}') as server:
        assert server.get(f'{series}/instances/{sops[24]}/thumbnail?viewport=40,20&accept=image/png') == one
        assert server.get(f'{series}/thumbnail')[:3] == b'\xff\xd8\xff' == server.get(f'{series}/thumbnail')[:3]
        server.refused(404, 'no such object', f'{series}/instances/1.2/thumbnail')
    shutil.rmtree('each')


def capabilities():
    """WADL by OPTIONS /; to a page of another site a preflight."""
    site = {'Origin': 'https://a.example', 'Access-Control-Request-Method': 'GET'}
    with Server(ctsplat, data, '--allow-origin', 'https://a.example') as server:
        status, headers, body = server.ask('/', method='OPTIONS')
        ids = [m.get('id') for m in xml.etree.ElementTree.fromstring(body).iter() if m.get('id')]
        assert status == 200 and headers['Content-Type'] == 'application/vnd.sun.wadl+xml' and ids == ['RetrieveThumbnail', 'RetrieveRendered3D']
        assert server.ask('/', method='OPTIONS', token=False)[0] == 401
        for path in '/', '/studies/1.2/thumbnail':
            status, headers, body = server.ask(path, site, method='OPTIONS', token=False)
            assert status == 200 and headers['Access-Control-Allow-Origin'] == 'https://a.example' and body == b'\n', headers
        server.refused(405, 'GET', '/series', method='OPTIONS')


def labels():
    """Views of one volume by its labels; an appearance names no file."""
    folder = os.path.join(os.path.dirname(data), 'fuzz', 'labels', 'first')
    with Server(ctsplat, data, '--labels', folder) as server:
        picture = f'/series/{server.series()[0]["id"]}/picture.png?{SMALL}&preset=muscle'
        plain = server.get(picture)
        assert plain == render('png', '--size', '64x48', '--png-bits', '8', '--preset', 'muscle')
        for query, words in [('hide=all', '--hide all'), ('label-colours=', '--label-colours'),
                             ('label=all%3D%23ff0000&hide=1', '--label all=#ff0000 --hide 1')]:
            own = render('png', '--size', '64x48', '--png-bits', '8', '--preset', 'muscle', '--labels', folder, *words.split())
            assert server.get(f'{picture}&{query}') == own != plain, query
        assert server.get(picture) == plain
        look = '{"label":{"1":"%s"}}'
        assert server.get(f'{picture}&look=' + look % '%23ff0000') == server.get(f'{picture}&label=1%3D%23ff0000')
        for refused in 'look.json', look % '/etc/passwd':
            server.refused(400, 'look|preset', picture + '&look=' + refused)
        listed = json.loads(server.get(f'/series/{server.series()[0]["id"]}/labels'))
        assert listed and all(label['name'] and label['voxels'] >= 0 for label in listed), listed
        server.refused(400, 'no label has this name or number', picture + '&hide=unknown')
        for look in '1=/etc/passwd', '1%3D/etc/passwd', 'a%3D/etc/passwd%3Dbone':
            server.refused(400, 'preset', picture + '&label=' + look)


def crowded(server, series):
    """Requests beyond the limit are asked to retry; cancelled ones are dropped; others are served meanwhile."""
    slow = f'/series/{series}/picture.png?size=2048x2048&engine=raycast&view='
    request = 'GET %s HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer ' + server.token + '\r\n\r\n'
    crowd = []
    start, headers = time.monotonic(), None
    while not headers:
        # Clients that were refused do not come back: others take the places of pictures that are done.
        for k in range(90 if not crowd else 20):
            crowd.append(socket.create_connection((server.host, server.port)))
            crowd[-1].sendall((request % (slow + f'{k},0')).encode())
        try:
            headers = server.refused(503, 'too many', slow + '0,0', timeout=1)
        except TimeoutError:
            assert time.monotonic() - start < 200, 'all of them may wait'
    assert headers['Retry-After'] == '1'
    for s in crowd:
        s.close()
    start = time.monotonic()
    while server.ask(f'/series/{series}/picture.png?{SMALL}')[0] == 503:
        assert time.monotonic() - start < 200, 'those who have gone are waited for'
        time.sleep(0.1)


def hostile_one(server, chance):
    """A malicious connection; the answer, if any, is HTTP."""
    alphabet = b'GETPOSHAD/ .:%?&=\r\n\0\xff{}[]"0123456789abcxyz'
    junk = bytes(chance.choice(alphabet) for _ in range(chance.randrange(1, 400)))
    start = chance.choice([b'', b'GET /series/', b'GET /studies/1.2/series/', b'GET / HTTP/1.1\r\nHost: ',
                           b'GET /series/%00%2e%2e/%2e%2e/picture.png?size=', b'POST /series HTTP/1.1\r\nHost: localhost\r\n'
                           b'Content-Length: 99999999999999999999\r\n\r\n', b'GET /' + b'a' * chance.randrange(70000),
                           b'GET /series HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\nffffffff\r\n',
                           b'GET /series?' + b'&'.join([b'size=8x8'] * 200) + b' HTTP/1.1\r\nHost: localhost\r\n'
                           b'Authorization: Bearer ' + server.token.encode() + b'\r\n\r\n'])
    with socket.create_connection((server.host, server.port)) as s:
        s.settimeout(2)
        try:
            s.sendall(start + junk)
            if chance.random() < 0.5:
                s.shutdown(socket.SHUT_WR)
                answer = s.recv(4096)
                assert not answer or answer.startswith(b'HTTP/1.'), answer
        except OSError:
            pass  # what is no request yet is waited for longer than this


def hostile(server, n):
    seed = int(os.environ.get('CTS_SEED', '1'))
    idle = [socket.create_connection((server.host, server.port)) for _ in range(1000 if soak else 100)]
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda k: hostile_one(server, random.Random(f'{seed} {k}')), range(n)))
    server.series()
    for s in idle:
        s.close()


def leaves_cleanly(series):
    """Requests under way when the server ends are answered."""
    with Server(ctsplat, data) as server:
        statuses = []
        slow = f'/series/{series}/picture.png?size=4096x4096&engine=raycast&view='
        askers = [threading.Thread(target=lambda k=k: statuses.append(server.ask(slow + f'{k},0')[0])) for k in range(6)]
        before = server.sockets()
        for a in askers:
            a.start()
        while server.sockets() < before + len(askers):
            time.sleep(0.01)
        time.sleep(1)
        server.process.terminate()
        for a in askers:
            a.join()
        assert statuses == [503] * 6, statuses


def handed_over():
    """A socket from outside, as systemd gives it."""
    with socket.socket(socket.AF_UNIX) as door:
        door.bind('handed.sock')
        door.listen()
        script = 'exec 3<&%d; LISTEN_PID=$$ LISTEN_FDS=1 exec "$@"' % door.fileno()
        with subprocess.Popen(['bash', '-c', script, 'sh', ctsplat, 'serve', data], stdout=subprocess.PIPE, text=True,
                              pass_fds=[door.fileno()], stderr=subprocess.DEVNULL) as process:
            process.stdout.readline()
            with socket.socket(socket.AF_UNIX) as s:
                s.connect('handed.sock')
                s.sendall(b'GET /series HTTP/1.0\r\n\r\n')
                assert b' 200 ' in s.recv(4096)
            process.terminate()
            assert process.wait(60) == 0
    assert os.path.exists('handed.sock'), 'it is not the server that made it'


def starts():
    """A failure to start is one line and the right exit code; a socket needs no token."""
    for code, text, args in [(2, 'nothing to serve', []), (3, 'no such|cannot be', ['nowhere', '--listen', '127.0.0.1:0']),
                             (2, 'need TLS', [data, '--listen', '0.0.0.0:0']), (2, 'HOST:PORT', [data, '--listen', 'x']),
                             (2, 'not a size', [data, '--memory', '1k', '--listen', '127.0.0.1:0']),
                             (3, '16 characters', [data, '--token-file', 'short', '--listen', '127.0.0.1:0']),
                             (2, 'not an option of serve', [data, '--preset', 'bone'])]:
        with open('short', 'w') as f:
            f.write('short\n')
        done = subprocess.run([ctsplat, 'serve', *args], capture_output=True, text=True, timeout=60)
        assert done.returncode == code and done.stderr.count('error:') == 1, (args, done)
    os.makedirs('empty')
    done = subprocess.run([ctsplat, 'serve', data], capture_output=True, text=True, env={**os.environ, 'CTSPLAT_LIBEXEC': 'empty'})
    assert done.returncode == 1 and 'ctsplat-serve is not in the folder of CTSPLAT_LIBEXEC' in done.stderr, done
    with Server(ctsplat, data) as server:
        with open(f'/proc/{server.process.pid}/comm') as f:
            assert f.read() == 'ctsplat-serve\n', 'one process, of that program'
        server.process.send_signal(signal.SIGINT)
        assert server.process.wait(60) == 0
    with Server(ctsplat, data, listen='unix:here.sock'):
        assert os.stat('here.sock').st_mode & 0o777 == 0o600
        with socket.socket(socket.AF_UNIX) as s:
            s.connect('here.sock')
            s.sendall(b'GET /series HTTP/1.0\r\n\r\n')
            assert b' 200 ' in s.recv(4096)
    assert not os.path.exists('here.sock')
    handed_over()


def memory():
    """The least recently used series is unloaded; where all are in use, an error says so."""
    with Server(ctsplat, data, '--memory', '1M') as server:
        picture = f'/series/{server.series()[0]["id"]}/picture.png?{SMALL}&crop=-500,500,-500,500,-500,'
        bodies = [server.get(picture + str(k)) for k in range(-60, 60, 10)]
        assert len(set(bodies)) == 12, 'crops differ'
        assert server.get(picture + "-60") == bodies[0]
        with ThreadPoolExecutor(8) as pool:
            for k, (status, _, body) in enumerate(pool.map(server.ask, [picture + str(k) for k in range(-60, 60, 10)])):
                assert body == bodies[k] if status == 200 else status == 503 and b'no room' in body, (status, body[:99])


def flood(series):
    """Many series one after the other: those that do not fit are unloaded, and memory stays constant."""
    sanitized = 'ASAN_OPTIONS' in os.environ or 'UBSAN_OPTIONS' in os.environ
    for k in range(6):
        os.makedirs(f'many/{k}')
        for name in os.listdir(data):
            with open(os.path.join(data, name), 'rb') as f:
                slices = f.read()
            with open(f'many/{k}/{name}', 'wb') as f:
                f.write(slices.replace(series, series[:-1] + b'%d' % k))
    with Server(ctsplat, 'many', '--memory', '1M') as server:
        listed = server.series()
        assert len({one['id'] for one in listed}) == 6, listed
        kib = []
        for _ in range(6 if sanitized else 20):
            assert len({server.get(f'/series/{one["id"]}/picture.png?{SMALL}') for one in listed}) == 1
            assert sum(one['loaded'] for one in server.series()) == 1
            kib.append(server.kib())
        # Without freeing, 19 rounds would add 6 volumes of 373 KiB each, 42,500 KiB. Buffers of the server's threads, which
        # come and go and are the later the busier the machine is, made up to 19,200.
        assert sanitized or kib[-1] - kib[0] < 30000, kib


def encrypted():
    """HTTPS with a certificate made here, beyond loopback too; nothing without TLS."""
    subprocess.run(['openssl', 'req', '-x509', '-newkey', 'rsa:2048', '-nodes', '-keyout', 'tls.key', '-out', 'tls.pem',
                    '-days', '2', '-subj', '/CN=test', '-addext', 'subjectAltName=IP:127.0.0.1'], check=True,
                   capture_output=True)
    pem = ['--tls-cert', 'tls.pem', '--tls-key', 'tls.key']
    with Server(ctsplat, data, *pem) as server:
        assert server.url.startswith('https:'), server.url
        server.tls = ssl.create_default_context(cafile='tls.pem')
        _, headers, body = server.ask(f'/series/{server.series()[0]["id"]}/picture.png?{SMALL}')
        assert body == render('png', '--size', '64x48', '--png-bits', '8')
        assert 'Secure' in server.ask('/?token=' + server.token, token=False)[1]['Set-Cookie']
        for other in None, ssl.create_default_context():
            server.tls = other
            try:
                raise AssertionError(server.ask('/series'))
            except (OSError, http.client.HTTPException):
                pass
    with Server(ctsplat, data, *pem, listen='0.0.0.0:0') as server:
        assert server.url.startswith('https:'), server.url
    swapped = [ctsplat, 'serve', data, '--tls-cert', 'tls.key', '--tls-key', 'tls.pem', '--listen', '127.0.0.1:0']
    done = subprocess.run(swapped, capture_output=True, text=True, timeout=60)
    assert done.returncode == 3 and done.stderr.count('error:') == 1 and 'holds no CERTIFICATE' in done.stderr, done


first = pydicom.dcmread(next(os.path.join(data, name) for name in sorted(os.listdir(data))))
starts()
with Server(ctsplat, data, '--host', 'known.example') as whole:
    listed = whole.series()
    assert len(listed) == 1 and listed[0]['renderable'] and listed[0]['dims'] == [64, 64, 48], listed
    name = listed[0]['id']
    equal_bytes(whole, name)
    words(whole, name)
    warned(whole, name)
    guarded(whole, name)
    rendered(whole, first.StudyInstanceUID, first.SeriesInstanceUID)
    hostile(whole, 10000 if soak else 300)
    crowded(whole, name)
    messages = whole.stderr()
    assert whole.series()[0]['id'] == name and whole.series()[0]['loaded']
assert data not in messages and first.SeriesInstanceUID not in messages and str(first.PatientName) not in messages, messages
states(first.StudyInstanceUID, first.SeriesInstanceUID, first.SOPInstanceUID)
thumbnails(first.StudyInstanceUID, first.SeriesInstanceUID)
capabilities()
labels()
leaves_cleanly(name)
memory()
flood(first.SeriesInstanceUID.encode())
encrypted()
