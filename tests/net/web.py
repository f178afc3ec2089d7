"""What a DICOMweb peer says is data: bad answers are refused, names are never paths, credentials stay secret."""
import base64
import glob
import os
import sys

import peers

ctsplat, loopback, data = os.path.abspath(sys.argv[1]), sys.argv[2], sys.argv[3]
run = peers.Ctsplat(ctsplat).run
web = peers.Web()
files = [open(path, 'rb').read() for path in sorted(glob.glob(data + '/*.dcm'))]
fetch = ['--from', web.url, '--study-uid', '1.2.3', '--size', '60x50']


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
assert web.asked[0][0] == '/rs/studies/1.2.3' and 'multipart/related' in web.asked[0][1]['Accept']
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

# Credentials come from a file or the environment, reach the peer, and are told to nobody else.
secret = 'someone:Geheim5'
basic = 'Basic ' + base64.b64encode(secret.encode()).decode()
open('secret', 'w').write('Bearer Token77\n')
answer(parts(files))
run(*fetch, '-o', 'got.png', '--force', '--log', 'log', '--credentials', 'secret')
assert web.asked[-1][1].get('Authorization') == 'Bearer Token77'
web.asked.clear()
said = run(*fetch, '-o', 'got.png', '--force', '--log', 'log', env={'CTSPLAT_CREDENTIALS': secret})
assert [headers.get('Authorization') for _, headers in web.asked] == [basic]
assert 'Geheim5' not in said + open('log').read() and 'Token77' not in open('log').read()
answer(b'{"00081199":{"vr":"SQ","Value":[]}}', 'application/dicom+json')
run(data, '--size', '60x50', '-o', 'up.dcm', '--send', web.url, env={'CTSPLAT_CREDENTIALS': secret}, code=5)
assert web.asked[-1][1].get('Authorization') == basic
run('--from', web.url.replace('//', '//user:password@'), '--study-uid', '1.2.3', '-o', 'none.png', code=2)

# Uploads: a status of success is not enough when the peer names what it stored, and it is not ours.
answer(b'{"00081199":{"vr":"SQ","Value":[]}}', 'application/dicom+json')
said = run(data, '--size', '60x50', '-o', 'kept.dcm', '--send', web.url, code=5)
assert 'kept.dcm' in said and os.path.exists('kept.dcm')
answer(b'<xml/>', 'application/dicom+xml')
run(data, '--size', '60x50', '-o', 'sent.dcm', '--send', web.url)

# What is asked for must be UIDs, and peers peers.
for bad in ('../x', '1.2;3', '', '1' * 65, '1..2'):
    run('--from', web.url, '--study-uid', bad, '-o', 'none.png', code=2)
for bad in ('host:104', 'AET@host', 'AET@:104', 'AET@host:0', 'AET@host:70000', 'A' * 17 + '@host:104', 'A@h o:1',
            'ftp://host/x', 'http://', 'http://host/x?y'):
    run('--from', bad, '--study-uid', '1.2.3', '-o', 'none.png', code=2)
    run(data, '--send', bad, '-o', 'none.dcm', code=2)
