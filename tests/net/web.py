"""A DICOMweb peer's answers are untrusted: bad ones are refused, names are never paths, credentials stay secret."""
import base64
import glob
import gzip
import json
import os
import subprocess
import sys
import time

import peers

ctsplat, loopback, data = os.path.abspath(sys.argv[1]), sys.argv[2], sys.argv[3]
run = peers.Ctsplat(ctsplat).run
web = peers.Web()
files = [open(path, 'rb').read() for path in sorted(glob.glob(data + '/*.dcm'))]


def value(file, tag):
    at = file.index(tag + b'UI') + 8
    return file[at:at + int.from_bytes(file[at - 2:at], 'little')].rstrip(b'\0').decode()


study, series = value(files[0], b'\x20\0\x0d\0'), value(files[0], b'\x20\0\x0e\0')
fetch = ['--from', web.url, '--study-uid', study, '--size', '60x50']


def parts(bodies, boundary=b'x', end=b'--', head=b'Content-Type: application/dicom\r\n'):
    body = b'preamble'
    for part in bodies:
        body += b'\r\n--' + boundary + b'\r\n' + head + b'\r\n' + part
    return body + b'\r\n--' + boundary + end + b'\r\n'


def answer(body, kind='multipart/related; type="application/dicom"; boundary=x', status=200):
    web.answer = (status, {'Content-Type': kind, 'Content-Length': str(len(body))}, body)


run(data, '--size', '60x50', '-o', 'truth.png')
truth = open('truth.png', 'rb').read()

# Good answers, in several ways of writing them; names in headers lead nowhere.
hostile = b'Content-Location: ../../../../tmp/evil.dcm\r\nContent-Disposition: attachment; filename="/tmp/evil"\r\n'
for head, kind in ((b'Content-Type: application/dicom\r\n', 'multipart/related; boundary=x'),
                   (hostile, 'Multipart/Related; type="application/dicom"; boundary="x"'), (b'', 'multipart/related;boundary=x')):
    answer(parts(files, head=head), kind)
    run(*fetch, '-o', 'got.png', '--force')
    assert open('got.png', 'rb').read() == truth
assert web.asked[0][0] == '/rs/studies/' + study and 'multipart/related' in web.asked[0][1]['Accept']
assert not glob.glob('/tmp/evil*')

# Bad ones: cut short, no boundary, another type, a header without end, statuses, nothing at all.
whole = parts(files[:3])
for body, kind in ((whole[:-4], None), (whole[:len(whole) // 2], None), (whole, 'multipart/related'),
                   (whole, 'text/html'), (whole, 'multipart/related; boundary=' + 'y' * 100),
                   (b'\r\n--x\r\n' + b'A' * 100000, None), (b'', None), (parts([]), None)):
    answer(body, kind or 'multipart/related; boundary=x')
    said = run(*fetch, '-o', 'none.png', code=3)
    assert said.count('\n') == 1 and not os.path.exists('none.png'), said
answer(parts([b'no DICOM at all \x1b[31m%n%s']))
said = run(*fetch, '-o', 'none.png', code=3)
assert '\x1b' not in said
for status in (401, 404, 500, 302):
    answer(b'\x1b[2J' * 100, 'text/html\x1b', status)
    said = run(*fetch, '-o', 'none.png', code=3)
    assert str(status) in said and '\x1b' not in said, said

# Credentials come from a file or the environment, and only the peer gets them.
secret = 'someone:Geheim5'
basic = 'Basic ' + base64.b64encode(secret.encode()).decode()
open('secret', 'w').write('Bearer Token77\n')
answer(parts(files))
run(*fetch, '-o', 'got.png', '--force', '--log', 'log', '--credentials', 'secret')
assert web.asked[-1][1].get('Authorization') == 'Bearer Token77'
web.asked.clear()
said = run(*fetch, '-o', 'got.png', '--force', '--log', 'log', env={'CTSPLAT_CREDENTIALS': secret})
assert {headers.get('Authorization') for _, headers in web.asked} == {basic}
assert 'Geheim5' not in said + open('log').read() and 'Token77' not in open('log').read()
answer(b'{"00081199":{"vr":"SQ","Value":[]}}', 'application/dicom+json')
run(data, '--size', '60x50', '-o', 'up.dcm', '--send', web.url, env={'CTSPLAT_CREDENTIALS': secret}, code=5)
assert web.asked[-1][1].get('Authorization') == basic
run('--from', web.url.replace('//', '//user:password@'), '--study-uid', '1.2.3', '-o', 'none.png', code=2)

# Uploads: a status of success is not enough when the peer names what it stored, and it is not ours.
answer(b'{"00081199":{"vr":"SQ","Value":[]}}', 'application/dicom+json')
said = run(data, '--size', '60x50', '-o', 'kept.dcm', '--send', web.url, code=5)
assert 'kept.dcm' in said and os.path.exists('kept.dcm')

# So it is when it names nothing: a login page, an empty body, a list of failures, a list in XML, which is not asked for,
# a list without end, or one of another instance.
run(data, '--size', '60x50', '-o', 'sent.dcm')
uid = value(open('sent.dcm', 'rb').read(), b'\x08\0\x18\0')
json_list = '{"%s":{"vr":"SQ","Value":[{"00081155":{"vr":"UI","Value":["%s"]}}]}}'
xml_list = ('<NativeDicomModel><DicomAttribute tag="%s" vr="SQ"><Item number="1"><DicomAttribute tag="00081155" vr="UI">'
            '<Value number="1">%s</Value></DicomAttribute></Item></DicomAttribute></NativeDicomModel>')
lies = [('<html><body>Log in, please</body></html>', 'text/html', 200), ('', 'application/dicom+json', 200),
        ('', '', 200), ('[]', 'application/dicom+json', 200), ('<xml/>', 'application/dicom+xml', 200),
        (json_list % ('00081198', uid), 'application/dicom+json', 200),
        (json_list % ('00081199', '1.2.3'), 'application/dicom+json', 200),
        (xml_list % ('00081199', uid), 'application/dicom+xml', 200),
        ('[' + json_list % ('00081199', uid) + ',' + json_list % ('00081198', uid) + ']', 'application/dicom+json', 200),
        (json_list % ('00081199', uid) + ' ' * (2 << 20), 'application/dicom+json', 200),
        ('{}', 'application/dicom+json', 202), (json_list % ('00081198', uid), 'application/dicom+json', 202),
        (json_list % ('00081199', uid), 'application/dicom+json', 409)]
for body, kind, status in lies:
    answer(body.encode(), kind, status)
    said = run(data, '--size', '60x50', '-o', 'sent.dcm', '--force', '--send', web.url, code=5)
    assert 'not sent' in said, (body[:60], said)
for body, kind in ((json_list % ('00081199', uid), 'application/dicom+json'),
                   ('[' + json_list % ('00081199', uid) + ']', 'application/dicom+json')):
    answer(body.encode(), kind)
    run(data, '--size', '60x50', '-o', 'sent.dcm', '--force', '--send', web.url)

# The lists decide, whatever the status: warnings and objects that are there already are sent with a note, other reasons are
# named, with advice that can help.
def reason(sequence, tag, number, name=None):
    return ('{"%s":{"vr":"SQ","Value":[{%s"%s":{"vr":"US","Value":[%d]}}]}}' % (
        sequence, '"00081155":{"vr":"UI","Value":["%s"]},' % (name or uid) if name != '' else '', tag, number)).encode()


STORED, FAILED, WARNING, FAILURE = '00081199', '00081198', '00081196', '00081197'
for status, body, code, says in (
        (202, reason(STORED, WARNING, 0xb000), 0, ['B000', 'coercion']),
        (202, reason(STORED, WARNING, 0xb000, uid + ' '), 0, ['B000']),
        (202, reason(STORED, WARNING, 0xb006), 0, ['B006', 'elements discarded']),
        (202, reason(FAILED, FAILURE, 0x110), 5, ['0110', 'processing failure', "the peer's log"]),
        (409, reason(FAILED, FAILURE, 45070), 0, ['already', 'B00E']), (409, reason(FAILED, FAILURE, 0x111), 0, ['already', '0111']),
        (409, reason(FAILED, FAILURE, 0x111, '1.2.3'), 5, ['status 409']),
        (409, reason(FAILED, FAILURE, 0x122, ''), 5, ['status 409', '0122', 'SOP class not supported', 'set up to store']),
        (409, reason(FAILED, FAILURE, 0xc122), 5, ['C122', 'transfer syntax', '--compress none']),
        (409, reason(FAILED, FAILURE, 0xa901), 5, ['A901', 'does not match SOP class']),
        (400, reason('0008119A', FAILURE, 0xc001, ''), 5, ['C001', 'cannot understand'])):
    answer(body, 'application/dicom+json', status)
    said = run(data, '--size', '60x50', '-o', 'sent.dcm', '--force', '--send', web.url, code=code)
    assert all(word in said for word in says) and ('not sent' in said) == (code == 5), (status, body, said)

# A busy peer is tried again after one second, and after two more.
asked_at = []


def busy():
    asked_at.append(time.monotonic())
    return web.stored() if len(asked_at) == 3 else (503, {'Content-Length': '0'}, b'')


web.answer = busy
run(data, '--size', '60x50', '-o', 'sent.dcm', '--force', '--send', web.url)
first, second = asked_at[1] - asked_at[0], asked_at[2] - asked_at[1]
assert first >= 1 and second >= 2 and first + second < 6, (first, second)

# Received objects must belong to the request, and be complete by the peer's own count.
other = [f.replace(study.encode(), study.encode()[:-1] + b'0') for f in files]
answer(parts(other))
said = run(*fetch, '-o', 'none.png', code=3)
assert 'StudyInstanceUID' in said and study[:-1] not in said, said
answer(parts(files[:-1] + other[-1:]))
run(*fetch, '-o', 'none.png', code=3)
answer(parts(files))
said = run(*fetch, '--series-uid', '1.2.3', '-o', 'none.png', code=3)
assert 'SeriesInstanceUID' in said, said


def counted(n, sent):
    body, count = parts(sent), ('[{"0020000E":{"vr":"UI","Value":["%s"]},"00201209":{"vr":"IS","Value":[%d]}}]' % (series, n)).encode()

    def report():
        if 'includefield' in web.asked[-1][0]:
            return 200, {'Content-Type': 'application/dicom+json', 'Content-Length': str(len(count))}, count
        return 200, {'Content-Type': 'multipart/related; boundary=x', 'Content-Length': str(len(body))}, body
    return report


for more in ([], ['--series-uid', series]):
    web.answer = counted(len(files), files)
    run(*fetch, *more, '-o', 'got.png', '--force')
    assert open('got.png', 'rb').read() == truth
    for sent in (files[:6], files[:6] * 8): # the same again is no more
        web.answer = counted(len(files), sent)
        said = run(*fetch, *more, '-o', 'none.png', code=3)
        assert '6 of 48 objects' in said, said

# Requested UIDs must be valid, and peers too.
for bad in ('../x', '1.2;3', '', '1' * 65, '1..2'):
    run('--from', web.url, '--study-uid', bad, '-o', 'none.png', code=2)
for bad in ('host:104', 'AET@host', 'AET@:104', 'AET@host:0', 'AET@host:70000', 'A' * 17 + '@host:104', 'A@h o:1',
            'ftp://host/x', 'http://', 'http://host/x?y'):
    run('--from', bad, '--study-uid', '1.2.3', '-o', 'none.png', code=2)
    run(data, '--send', bad, '-o', 'none.dcm', code=2)

# Credentials are not sent unencrypted over the network.
secret = {'CTSPLAT_CREDENTIALS': 'user:secret'}
for host in ('192.0.2.1', '127.example.org', 'localhost.example.org:80'):
    said = run('--from', 'http://%s/rs' % host, '--study-uid', '1.2.3', '-o', 'none.png', code=2, env=secret)
    assert '--insecure-http' in said and 'secret' not in said, said
said = run('--from', 'http://nowhere.invalid/rs', '--insecure-http', '--study-uid', '1.2.3', '-o', 'none.png', code=3,
           env=secret)
# Traffic to this machine bypasses every proxy.
answer(parts(files))
run(*fetch, '-o', 'got.png', '--force', env=dict(secret, http_proxy='http://127.0.0.1:9', all_proxy='http://127.0.0.1:9'))
assert open('got.png', 'rb').read() == truth

# One object without multipart, content that is compressed unasked, and redirects within the host, with the credentials.
for kind, encode in (('application/dicom', gzip.compress), ('application/dicom; transfer-syntax=1.2.840.10008.1.2.1', bytes)):
    web.answer = (200, {'Content-Type': kind, **({'Content-Encoding': 'gzip'} if encode == gzip.compress else {})}, encode(files[0]))
    said = run(*fetch, '-o', 'none.png', code=4)
    assert 'slice' in said, said
packed = gzip.compress(parts(files))
web.answer = (200, {'Content-Type': 'multipart/related; boundary=x', 'Content-Encoding': 'gzip'}, packed)
run(*fetch, '-o', 'got.png', '--force')
assert open('got.png', 'rb').read() == truth
web.answer = (200, {'Content-Type': 'multipart/related; boundary=x', 'Content-Encoding': 'gzip'}, packed[:len(packed) // 2])
run(*fetch, '-o', 'none.png', code=3)


def redirected(to, status=301, body=None):
    def report():
        if web.asked[-1][0].startswith('/rs/'):
            return status, {'Location': to + web.asked[-1][0][4:], 'Content-Length': '0'}, b''
        return body() if body else (200, {'Content-Type': 'multipart/related; boundary=x'}, parts(files))
    return report


web.asked.clear()
for to, status in (('/v2/', 302), (web.url[:-2].replace('//', '//x:y@') + 'v2/', 307), ('/v2/', 308)):
    web.answer = redirected(to, status)
    run(*fetch, '-o', 'got.png', '--force', env={'CTSPLAT_CREDENTIALS': 'user:secret'})
    assert open('got.png', 'rb').read() == truth
assert len({headers.get('Authorization') for _, headers in web.asked}) == 1 and web.asked[0][1]['Authorization']
web.answer = redirected('/v2/', 308, lambda: web.stored())
run(data, '--size', '60x50', '-o', 'sent.dcm', '--force', '--send', web.url)
other = peers.Web()
for to in (other.url + '/', web.url.replace('http:', 'https:') + '/', web.url.replace('127.0.0.1', 'localhost') + '/', '/rs/x/'):
    web.answer = redirected(to)
    said = run(*fetch, '-o', 'none.png', code=3, env={'CTSPLAT_CREDENTIALS': 'user:secret'})
    assert 'redirects' in said and said.count('\n') == 1 and not other.asked, said


# Searches: pages, padded UIDs, answers twice, and answers that contradict a key.
def padded(uid, n):
    return uid + (' ', '\0', '', '  ')[n % 4]


def archive(patients, page=1000, offset=True, warning=None):
    """Studies 1.N of these patients, each with series 1.N.1 twice, whatever the keys; `page` of them an answer."""
    def report():
        path, _, query = web.asked[-1][0].partition('?')
        words = dict(word.split('=') for word in query.split('&') if word)
        if path.endswith('/studies'):
            found = [{'0020000D': ('UI', padded('1.%d' % n, n)), '00080020': ('DA', '2020%02d01' % (n % 12 + 1)),
                      '00080050': ('SH', 'A%d' % n), **({'00100020': ('LO', patient)} if patient else {})}
                     for n, patient in enumerate(patients)]
        else:
            n = path.split('/')[-2].split('.')[1]
            found = [{'0020000E': ('UI', padded('1.%s.1' % n, k)), '00080060': ('CS', 'CT'), '00201209': ('IS', 12)} for k in (0, 1)]
        start = int(words.get('offset', 0)) if offset else 0
        if offset is None and 'offset' in words:
            return 400, {'Content-Length': '0'}, b''
        body = json.dumps([{tag: {'vr': vr, 'Value': [value]} for tag, (vr, value) in one.items()}
                           for one in found[start:start + page]]).encode()
        return 200, {'Content-Type': 'application/dicom+json', **({'Warning': warning} if warning and ('exceeded' not in warning or start + page < len(found)) else {})}, body
    return report


def find(*query, code=0):
    done = subprocess.run([ctsplat, 'info', '--json', '--from', web.url, *query], capture_output=True, text=True)
    assert done.returncode == code, (query, done.returncode, done.stderr)
    return [(s['series_uid'], s['objects']) for s in json.loads(done.stdout)['series']] if not code else [], done.stderr


many = ['P%d' % n for n in range(250)]
all_of = [('1.%d.1' % n, 12) for n in range(250)]
for page in (12, 100, 200, 250):
    web.answer = archive(many, page)
    assert find('--patient-id', 'P*')[0] == all_of, page
for offset, says in ((False, ''), (None, 'first 12 results')): # ignores it, refuses it
    web.answer = archive(many, 12, offset)
    got, said = find('--patient-id', 'P*')
    assert got == all_of[:12] and says in said, (offset, got, said)
web.answer = archive(many, 100, warning='299 rs: "The number of results exceeded the maximum. Additional results can be requested."')
assert find('--patient-id', 'P*')[0] == all_of
for query, expected in ((['--patient-id', 'P2'], [2]), (['--patient-id', ' P2 '], [2]), (['--patient-id', 'P?2'], [12, 22]),
                        (['--accession', 'A3'], [3]), (['--study-date', '20200201-20200301'], [1, 2, 13, 14]),
                        (['--study-date', '202002*'], [1, 13]), (['--study-uid', '1.7'], [7]),
                        (['--patient-id', 'P4', '--series-uid', '1.4.1'], [4]), (['--patient-id', 'p2'], [])):
    web.answer = archive(many[:24], 12)
    got, said = find(*query, code=0 if expected else 3)
    assert got == [all_of[n] for n in expected] and 'left out' in said, (query, got, said)
assert 'P2' not in said, said
web.answer = archive(['P1', None, 'P2', 'MÜ', 'MÖ'], warning='299 rs: "PatientID is not supported"')
got, said = find('--patient-id', 'P2')
assert got == all_of[1:3] and 'Warning 299' in said, (got, said)
assert find('--patient-id', 'MÜ')[0] == [all_of[1], all_of[3]]
assert find('--patient-id', 'P2', '--modality', 'MR', code=3)[0] == []

# Of a peer that does not say whose studies it lists, no other patient's objects are rendered.
def nameless():
    path = web.asked[-1][0].partition('?')[0]
    tag, uid = ('0020000D', study) if path.endswith('/studies') else ('0020000E', series)
    if not path.endswith(('/studies', '/series')):
        return 200, {'Content-Type': 'multipart/related; boundary=x'}, parts(files)
    return 200, {'Content-Type': 'application/dicom+json'}, json.dumps([{tag: {'vr': 'UI', 'Value': [uid]}}]).encode()


web.answer = nameless
patient = files[0][files[0].index(b'\x10\0\x20\0LO') + 8:][:files[0][files[0].index(b'\x10\0\x20\0LO') + 6]].decode().strip()
for key, code in ((patient, 0), (patient[:-1] + '?', 0), (patient + '1', 8)):
    done = subprocess.run([ctsplat, 'batch', '--from', web.url, '--patient-id', key, '-O', 'of' + str(len(key)), '--size', '40x30',
                           '--fresh'], capture_output=True, text=True)
    assert done.returncode == code and ('another patient' in done.stderr) == (code != 0), (key, done)

# A list that the peer has cut off is not taken for a whole one.
found = ('[{"0020000D":{"vr":"UI","Value":["%s"]},"0020000E":{"vr":"UI","Value":["%s"]}}]' % (study, series)).encode()
for warning, code in ((None, 0), ('299 rs: "The fuzzymatching parameter is not supported."', 0),
                      ('299 rs: "The number of results exceeded the maximum supported by the server."', 3)):
    web.answer = (200, {'Content-Type': 'application/dicom+json', 'Content-Length': str(len(found)),
                        **({'Warning': warning} if warning else {})}, found)
    done = subprocess.run([ctsplat, 'info', '--from', web.url, '--study-uid', study], capture_output=True, text=True)
    assert done.returncode == code and (code == 0) == (series in done.stdout), done
    assert code == 0 or 'narrow the query' in done.stderr, done
