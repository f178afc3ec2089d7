"""A DICOMweb peer's answers are untrusted: bad ones are refused, names are never paths, credentials stay secret."""
import base64
import glob
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

# So it is when it names nothing: a login page, an empty body, a list of failures, in JSON or XML, a list without end, or
# one of another instance; and a 202 promises only.
run(data, '--size', '60x50', '-o', 'sent.dcm')
uid = value(open('sent.dcm', 'rb').read(), b'\x08\0\x18\0')
json_list = '{"%s":{"vr":"SQ","Value":[{"00081155":{"vr":"UI","Value":["%s"]}}]}}'
xml_list = ('<NativeDicomModel><DicomAttribute tag="%s" vr="SQ"><Item number="1"><DicomAttribute tag="00081155" vr="UI">'
            '<Value number="1">%s</Value></DicomAttribute></Item></DicomAttribute></NativeDicomModel>')
lies = [('<html><body>Log in, please</body></html>', 'text/html', 200), ('', 'application/dicom+json', 200),
        ('', '', 200), ('[]', 'application/dicom+json', 200), ('<xml/>', 'application/dicom+xml', 200),
        (json_list % ('00081198', uid), 'application/dicom+json', 200),
        (json_list % ('00081199', '1.2.3'), 'application/dicom+json', 200),
        (xml_list % ('00081198', uid), 'application/dicom+xml', 200),
        (xml_list % ('00081199', uid + '1'), 'application/dicom+xml', 200),
        ('[' + json_list % ('00081199', uid) + ',' + json_list % ('00081198', uid) + ']', 'application/dicom+json', 200),
        (json_list % ('00081199', uid) + ' ' * (2 << 20), 'application/dicom+json', 200),
        (json_list % ('00081199', uid), 'application/dicom+json', 202)]
for body, kind, status in lies:
    answer(body.encode(), kind, status)
    said = run(data, '--size', '60x50', '-o', 'sent.dcm', '--force', '--send', web.url, code=5)
    assert 'not sent' in said, (body[:60], said)
for body, kind in ((json_list % ('00081199', uid), 'application/dicom+json'),
                   ('[' + json_list % ('00081199', uid) + ']', 'application/dicom+json'),
                   (xml_list % ('00081199', uid), 'application/dicom+xml')):
    answer(body.encode(), kind)
    run(data, '--size', '60x50', '-o', 'sent.dcm', '--force', '--send', web.url)

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

# A list that the peer has cut off is not taken for a whole one.
found = ('[{"0020000D":{"vr":"UI","Value":["%s"]},"0020000E":{"vr":"UI","Value":["%s"]}}]' % (study, series)).encode()
for warning, code in ((None, 0), ('299 rs: "The fuzzymatching parameter is not supported."', 0),
                      ('299 rs: "The number of results exceeded the maximum supported by the server."', 3)):
    web.answer = (200, {'Content-Type': 'application/dicom+json', 'Content-Length': str(len(found)),
                        **({'Warning': warning} if warning else {})}, found)
    done = subprocess.run([ctsplat, 'info', '--from', web.url, '--study-uid', study], capture_output=True, text=True)
    assert done.returncode == code and (code == 0) == (series in done.stdout), done
    assert code == 0 or 'narrow the query' in done.stderr, done
