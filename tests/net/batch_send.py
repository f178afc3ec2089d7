"""`batch --send`: each capture reaches the PACS once, for any failure on the way and any number of runs."""
import glob
import json
import os
import subprocess
import sys

import peers

ctsplat, loopback, data = os.path.abspath(sys.argv[1]), sys.argv[2], sys.argv[3]
peers.need('storescp')
N_SERIES = 4


def batch(*words, code=0):
    done = subprocess.run([ctsplat, 'batch', 'archive', '--size', '40x40', '--views', 'anterior,left', *words],
                          stdin=subprocess.DEVNULL, capture_output=True, text=True)
    assert done.returncode == code, (words, done.returncode, done.stderr)
    return done.stderr


def lines(folder):
    with open(folder + '/batch.jsonl') as f:
        return [json.loads(line) for line in f]


def captures(line):
    return [o for o in line['outputs'] if o['format'] == 'dcm']


def times(folder):
    return {p: os.stat(p).st_mtime_ns for p in glob.glob(folder + '/*/*.*')}


uid = json.loads(subprocess.run([ctsplat, 'info', data, '--json'], capture_output=True).stdout)['series'][0]['series_uid']
for i in range(N_SERIES):
    os.makedirs('archive/%d' % i)
    for k, path in enumerate(sorted(glob.glob(data + '/*.dcm'))):
        with open(path, 'rb') as f, open('archive/%d/%d.dcm' % (i, k), 'wb') as g:
            g.write(f.read().replace(uid.encode(), (uid[:-3] + '7%02d' % i).encode()))

# Each capture once; a run that has nothing to do sends nothing; another preset sends its own.
pacs = peers.Storescp('pacs', loopback)
to = 'ARCHIVE@127.0.0.1:%d' % pacs.port
words = ['-O', 'o', '--formats', 'png,dcm', '--send', to]
batch(*words)
assert pacs.count() == 2 * N_SERIES, pacs.count()
for line in lines('o'):
    assert line['status'] == 'done' and 'unsent' not in line, line
    assert [c['sent_to'] for c in captures(line)] == [[to]] * 2, line
    assert not [o for o in line['outputs'] if o['format'] == 'png' and 'sent_to' in o], line
assert 'of them in earlier runs' in batch(*words) and pacs.count() == 2 * N_SERIES
batch(*words, '--presets', 'bone,skin')
assert pacs.count() == 4 * N_SERIES, pacs.count()
# Captures rendered again are new ones; up-to-date ones of a batch that sent nothing are sent.
batch(*words, '--compress', 'rle')
assert pacs.count() == 6 * N_SERIES, pacs.count()
batch('-O', 'later', '--formats', 'dcm')
before = times('later')
batch('-O', 'later', '--formats', 'dcm', '--send', to)
assert pacs.count() == 8 * N_SERIES and times('later') == before, pacs.count()

# A PACS that is down: written, not sent, reported; the next run sends without rendering again.
pacs.end()
said = batch(*words, '--presets', 'skin,muscle', code=8)
assert said.count('not sent') == 4 and '%d more series' % (N_SERIES - 3) in said and '%d failed' % N_SERIES in said, said
for line in lines('o'):
    assert line['status'] == 'failed' and line['exit_code'] == 5 and 'not sent' in line['reason'], line
    assert line['unsent'] == 2 and all(os.path.exists('o/' + c['path']) for c in captures(line)), line
before = times('o')
pacs = peers.Storescp('pacs', loopback, pacs.port)
n = pacs.count()
batch(*words, '--presets', 'skin,muscle')
assert times('o') == before and all(line['status'] == 'done' for line in lines('o'))
# The captures of skin exist already.
assert pacs.count() == n + 2 * N_SERIES, pacs.count()
pacs.end()
# Captures queued for a PACS are finished for a batch without one.
batch('-O', 'o', '--formats', 'png,dcm', '--presets', 'skin,muscle')

# A PACS that refuses half-way: what it took is not sent to it again.
web = peers.Web()
answers = [web.stored] * 3


def answer():
    return answers.pop()() if answers else (403, {'Content-Length': '0'}, b'')


web.answer = answer
words = ['-O', 'web', '--formats', 'dcm', '--send', web.url]
said = batch(*words, code=8)
assert '403' in said, said
sent = [c['path'] for line in lines('web') for c in captures(line) if c.get('sent_to') == [web.url]]
assert len(sent) == 3, sent
assert [line['status'] for line in lines('web')].count('done') == 1, lines('web')
web.asked.clear()
web.answer = web.stored
batch(*words)
assert len(web.asked) == 2 * N_SERIES - 3, len(web.asked)
assert all(line['status'] == 'done' and 'unsent' not in line for line in lines('web'))

batch('-O', 'none', '--formats', 'dcm', '--send', to, '--aet', 'a name that is too long', code=2)
said = batch('-O', 'none', '--send', to, code=2)
assert '--format dcm' in said and not os.path.exists('none'), said
