"""Series on their way: a scanner, Orthanc or storescp, the unit's command each minute, captures in the study. The command has
the system calls that the unit leaves it: receivers.py CTSPLAT LOOPBACK_SO DATA UNIT_FILTER"""
import glob
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import time
import urllib.request

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, '..', 'net'))
import peers  # noqa: E402

ctsplat, loopback, data, unit_filter = map(os.path.abspath, sys.argv[1:])
DEPLOY = os.path.join(HERE, '..', '..', 'src', 'app', 'deploy')
PICTURES = '--presets bone --formats dcm --size 48x48 --threads 1'
with open(os.path.join(DEPLOY, 'ctsplat-batch.service')) as f:
    UNIT = f.read()
os.environ['SOURCE_DATE_EPOCH'] = '1000000000'
peers.need('storescp', 'storescu', 'dcmodify')


def allowed_calls():
    """Names of the system calls that the unit's filter leaves."""
    groups, left = {}, set()
    said = subprocess.run(['systemd-analyze', 'syscall-filter', '--no-pager'], capture_output=True, text=True).stdout
    for line in said.splitlines():
        word = line.split('#')[0].strip()
        if line.startswith('@'):
            group = groups.setdefault(word, [])
        elif word:
            group.append(word)

    def calls(words):
        return {c for w in words for c in (calls(groups[w]) if w.startswith('@') else [w])}

    for words in re.findall('^SystemCallFilter=(.*)', UNIT, re.M):
        left = left - calls(words[1:].split()) if words.startswith('~') else left | calls(words.split())
    return left


under = []
if shutil.which('systemd-analyze'):
    with open('allowed', 'w') as f:
        f.write('\n'.join(sorted(allowed_calls())) + '\n')
    # A search for leaks calls ptrace, which the unit keeps away.
    under = ['env', 'ASAN_OPTIONS=detect_leaks=0', unit_filter, 'allowed']
    assert subprocess.run(under + ['chroot', '/', 'true'], capture_output=True).returncode, 'nothing is kept away'


def minute(folder, out, settled=1, options='', code=0):
    """A run of the service; its messages."""
    values = dict(re.findall(r'^Environment="?(CTSPLAT_\w+)=(.*?)"?$', UNIT, re.M), CTSPLAT_BATCH_PATH=folder,
                  CTSPLAT_BATCH_SETTLED=str(settled), CTSPLAT_BATCH_OPTIONS=PICTURES + ' ' + options)
    words = []
    for word in shlex.split(re.search('^ExecStart=(.*)', UNIT, re.M).group(1)):
        word = {'@BINDIR@/ctsplat': ctsplat, '/var/lib/ctsplat/out': out}.get(word, word)
        whole = re.fullmatch(r'\$(\w+)', word)
        words += values[whole.group(1)].split() if whole else [re.sub(r'\$\{(\w+)\}', lambda m: values[m.group(1)], word)]
    done = subprocess.run(under + words, stdin=subprocess.DEVNULL, capture_output=True, text=True)
    assert done.returncode == code, (words, done.returncode, done.stderr)
    return done.stderr


def send(port, called, paths, aet='CT1', *words):
    return subprocess.run(['storescu', *words, '-aet', aet, '-aec', called, '127.0.0.1', str(port), *paths],
                          capture_output=True).returncode


def records(out):
    with open(out + '/batch.jsonl') as f:
        # The captures that came back are images without a volume.
        return {r['series_uid']: r for r in map(json.loads, f) if r['status'] != 'thumbnail'}


def captures(out):
    return sorted(glob.glob(out + '/*/*.dcm'))


def contents(out):
    return {path[len(out):]: open(path, 'rb').read() for path in captures(out)}


def until(true, what, seconds=120):
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, what
        time.sleep(0.1)


def through_orthanc():
    with open(os.path.join(DEPLOY, 'orthanc.json')) as f:
        text = f.read()
    assert text.count('\n') <= 10, 'the configuration is to be ten lines'
    more = {k: v for k, v in json.loads(text).items() if k not in ('StorageDirectory', 'IndexDirectory', 'Plugins', 'DicomPort')}
    folder, script = os.path.abspath('placed'), os.path.join(DEPLOY, 'ctsplat_orthanc.py')
    assert more['PythonScript'].endswith('/ctsplat_orthanc.py') and more['Ctsplat']['Batch'] is True
    more['DicomModalities']['scanner']['Host'] = '127.0.0.1'
    more['DicomModalities']['ctsplat'] = {'AET': 'CTSPLAT', 'Host': '127.0.0.1', 'Port': 104}
    more.update(PythonScript=script, StableAge=1, Ctsplat=dict(more['Ctsplat'], Folder=folder, Previews=False))
    pacs = peers.Orthanc(os.path.abspath('pacs'), loopback, more=more)
    slices, n_captures = sorted(glob.glob(data + '/*.dcm')), 0
    try:
        assert send(pacs.dicom, 'ORTHANC', slices[:1], 'STRANGER') and not pacs.instances(), 'a stranger may store'
        for first, last in (0, 30), (30, 48):
            stable = os.path.getmtime(folder + '/.stable') if n_captures else 0
            assert send(pacs.dicom, 'ORTHANC', slices[first:last]) == 0
            until(lambda: os.path.exists(folder + '/.stable') and os.path.getmtime(folder + '/.stable') > stable,
                  'Orthanc touches no .stable')
            said = minute(folder, 'rendered', options='--send %s/dicom-web' % pacs.url)
            record, = records('rendered').values()
            assert record['status'] == 'done' and record['files'] == last, (said, record)
            # In the study of the slices, and there once.
            n_captures += 1
            study, = pacs.json('/studies')
            assert len(pacs.json('/studies/%s/instances' % study)) == pacs.instances() == last + n_captures, said
            until(lambda: all(pacs.json('/series/' + s)['IsStable'] for s in pacs.json('/series')), 'not stable')
            time.sleep(4)
            minute(folder, 'rendered', options='--send %s/dicom-web' % pacs.url)
            assert minute(folder, 'rendered', options='--send %s/dicom-web' % pacs.url) == '', 'captures come back as work'
            assert pacs.instances() == last + n_captures
        # The same by C-STORE: what the PACS has stays one object.
        minute(folder, 'rendered', options='--send ORTHANC@127.0.0.1:%d' % pacs.dicom)
        assert pacs.instances() == 48 + n_captures
        # A PACS that is down fails the series, which is sent later; slices deleted meanwhile take no picture away.
        before = contents('rendered')
        pacs.kill()
        minute(folder, 'rendered', options='--send %s/dicom-web --aet X --presets skin' % pacs.url, code=8)
        record, = records('rendered').values()
        assert record['tries'] == 1 and record['unsent'] == 1, record
        pacs.start()
        time.sleep(2)
        minute(folder, 'rendered', options='--send %s/dicom-web --aet X --presets skin' % pacs.url)
        assert pacs.instances() == 48 + n_captures + 1
        series = record['series_uid']
        name = next(s for s in pacs.json('/series') if pacs.json('/series/' + s)['MainDicomTags']['SeriesInstanceUID'] == series)
        urllib.request.urlopen(urllib.request.Request(pacs.url + '/series/' + name, method='DELETE'), timeout=120)
        until(lambda: not os.path.isdir(os.path.join(folder, series)), 'the folder of a deleted series stays')
        minute(folder, 'rendered')
        assert before.items() <= contents('rendered').items(), 'pictures went with the slices'
    finally:
        pacs.kill()


def through_storescp():
    port = peers.free_port()
    os.makedirs('in')
    process = subprocess.Popen(['storescp', '--fork', '--accept-all', '--sort-on-study-uid', 'ST', '--output-directory', 'in',
                                '--aetitle', 'CTSPLAT', str(port)], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                               stderr=subprocess.DEVNULL, env=dict(os.environ, LD_PRELOAD=loopback))
    testdata = os.path.join(data, '..')
    studies = {'whole': data, 'jpeg': testdata + '/syntax/jpeg-2000', 'late': testdata + '/geometry/feet-first'}
    try:
        peers.wait_for_port(port, process)
        for number, (name, source) in enumerate(studies.items()):
            shutil.copytree(source, name)
            files = glob.glob(name + '/*')
            assert subprocess.run(['dcmodify', '-q', '-nb', '-gin', '-m', '(0020,000D)=1.2.826.0.1.%d' % number, '-m',
                                   '(0020,000E)=1.2.826.0.1.%d.1' % number, *files]).returncode == 0
        late = sorted(glob.glob('late/*'))
        assert send(port, 'CTSPLAT', glob.glob('whole/*')) == send(port, 'CTSPLAT', late[:4]) == 0
        assert send(port, 'CTSPLAT', glob.glob('jpeg/*'), 'CT1', '-xv') == 0
        assert not any(path.endswith('.dcm') for path in glob.glob('in/*/*')) and len(glob.glob('in/ST*')) == 3
        assert 'waiting' in minute('in', 'out')
        time.sleep(2.1)
        minute('in', 'out')
        states = {uid: (r['status'], r['files']) for uid, r in records('out').items()}
        assert states['1.2.826.0.1.0.1'] == ('done', 48) and states['1.2.826.0.1.1.1'][0] == 'done', states
        # A run while the rest arrives, and a file that is cut: it waits, or the next run renders the whole.
        sender = subprocess.Popen(['storescu', '-aec', 'CTSPLAT', '127.0.0.1', str(port), *late[4:]])
        minute('in', 'out')
        assert sender.wait() == 0
        time.sleep(2.1)
        minute('in', 'out')
        assert records('out')['1.2.826.0.1.2.1']['files'] == len(late), records('out')['1.2.826.0.1.2.1']
        minute('in', 'again')
        assert contents('again') == contents('out') and len(contents('out')) == 3, 'not those of one run'
        # The unit's purge takes studies, and no younger one.
        os.utime(glob.glob('in/ST*826.0.1.0')[0], (0, time.time() - 9 * 86400))
        purge = re.search('^ExecStartPost=(.*)', UNIT, re.M).group(1).replace('/var/lib/ctsplat/in', 'in')
        subprocess.run(shlex.split(purge.replace('${CTSPLAT_BATCH_KEEP}', '7')), check=True)
        assert len(glob.glob('in/ST*')) == 2, os.listdir('in')
        assert minute('in', 'out') and len(contents('out')) == 3
    finally:
        process.kill()


FULL = '''mount -t tmpfs -o size=%s none full && head -c 100M /dev/zero >full/filler 2>/dev/null
%s; echo "code $?"; rm full/filler; sleep 3; %s; echo "code $?"; ls full/*/*.dcm'''


def full_storage():
    """A full disk ends a run with a message; once there is room the next one comes to the pictures."""
    os.mkdir('full')
    command = shlex.join([ctsplat, 'batch', 'late', '-O', 'full', '--settled', '1', *PICTURES.split()])
    done = subprocess.run(['unshare', '-rm', 'sh', '-c', FULL % ('400k', command, command)], capture_output=True, text=True)
    if 'unshare' in done.stderr or 'mount' in done.stderr:
        return print('no mounts here: the full storage is left out')
    assert done.stdout.split()[:2] == ['code', '5'] and 'code 0' in done.stdout and '.dcm' in done.stdout, done
    assert 'No space left' in done.stderr, done.stderr


def former_node():
    """The package's script translates a node's settings and touches nothing of it; the former program names its replacement."""
    os.makedirs('root/etc/ctsplat')
    with open('root/etc/ctsplat/node.conf', 'w') as f:
        f.write('# x\nCTSPLAT_NODE_DIR=/data/node\nCTSPLAT_NODE_PACS="ARCHIVE@pacs:104"\nCTSPLAT_NODE_ALLOW=*@192.0.2.1 A@192.0.2.2\n'
                'CTSPLAT_NODE_OPTIONS=--presets skin $(touch evil)\nCTSPLAT_NODE_KEEP=14\n#CTSPLAT_NODE_QUIET=9\n')
    before = open('root/etc/ctsplat/node.conf').read()
    done = subprocess.run(['sh', os.path.join(DEPLOY, 'debian', 'postinst'), 'configure'], capture_output=True, text=True,
                          env=dict(os.environ, DPKG_ROOT='root'), check=True)
    assert 'man ctsplat-batch' in done.stdout and open('root/etc/ctsplat/node.conf').read() == before, done
    lines = open('root/etc/ctsplat/batch.conf.node').read().splitlines()[1:]
    assert lines == ['CTSPLAT_BATCH_PATH="/data/node/in"', 'CTSPLAT_BATCH_KEEP="14"',
                     'CTSPLAT_BATCH_OPTIONS="--presets skin $(touch evil) --send ARCHIVE@pacs:104"',
                     '# of the receiver now: CTSPLAT_NODE_ALLOW=*@192.0.2.1 A@192.0.2.2'], lines
    assert not os.path.exists('evil')
    for words in [], ['--help'], ['/etc/ctsplat/node.conf']:
        done = subprocess.run(['sh', os.path.join(DEPLOY, 'ctsplat-node'), *words], capture_output=True, text=True)
        assert done.returncode == 2 and done.stderr.count('\n') == 1 and 'ctsplat-batch.timer' in done.stderr, (words, done)


former_node()
if shutil.which('Orthanc') and glob.glob('/usr/*/orthanc/plugins/*Python*') and glob.glob('/usr/*/orthanc/plugins/*DicomWeb*'):
    through_orthanc()
through_storescp()
full_storage()
