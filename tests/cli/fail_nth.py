#!/usr/bin/env python3
"""The n-th call fails, for every n until none does: fail_nth.py CTSPLAT SHIM TESTDATA CALL [STEP [DCM_STEP]]

For any failing call, the program ends with a picture and exit 0 (it could do without), or with one error line,
its own exit code, and no output; never by a signal, never with a partial file. With a STEP only every STEP-th
call; a DICOM output has a step of its own, since most of its allocations are small ones of the dictionary."""
import os
import shutil
import subprocess
import sys
import tempfile

ctsplat, shim, data, call = (os.path.abspath(a) if os.path.exists(a) else a for a in sys.argv[1:5])
all_step = int(sys.argv[5]) if len(sys.argv) > 5 else 1
dcm_step = int(sys.argv[6]) if len(sys.argv) > 6 else all_step
os.environ['SOURCE_DATE_EPOCH'] = '1000000000'
work = tempfile.mkdtemp()
out, mark = os.path.join(work, 'out'), os.path.join(work, 'mark')
failures = 0


def outputs():
    """The files in the folder of outputs, which is emptied afterwards."""
    found = {}
    for name in os.listdir(out):
        with open(os.path.join(out, name), 'rb') as f:
            found[name] = f.read()
        os.unlink(os.path.join(out, name))
    return found


def excused(name, said):
    """A warning excuses what is missing: a file that cannot be read may be left out, and a slice whose decoder is
    killed again and again, but nothing because memory is short."""
    return call != 'malloc' and (call != 'kill' or name == 'killed') and b'warning' in said


def run(name, step, command, **more):
    global failures
    n, count = 1, 0
    mark_as = {'CTS_FAIL': call, 'CTS_FAIL_MARK': mark, **more}
    whole = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, env={**os.environ, **more})
    if whole.returncode:
        sys.exit('FAIL %s: %s' % (name, whole.stderr.decode(errors='replace')))
    good = outputs()
    while True:
        with tempfile.TemporaryFile() as messages: # a pipe would stay open as long as any child of the program lives
            code = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=messages,
                                  timeout=60, env={**os.environ, **mark_as, 'LD_PRELOAD': shim, 'CTS_FAIL_AT': str(n)},
                                  ).returncode
            messages.seek(0)
            said = messages.read()
        made = outputs()
        if not os.path.exists(mark):
            break
        os.unlink(mark)
        errors = sum(line.startswith(b'ctsplat: error: ') for line in said.splitlines())
        wrong = None
        if code < 0 or code > 130: # a signal
            wrong = 'exit %d' % code
        elif errors != (code != 0):
            wrong = 'exit %d with %d error lines' % (code, errors)
        elif any(good.get(file) != made[file] for file in made) and not excused(name, said):
            wrong = 'exit %d leaves something else' % code
        elif code == 0 and made.keys() != good.keys():
            wrong = 'exit 0 without its outputs'
        if wrong:
            print('FAIL %s: %s number %d: %s: %s' % (name, call, n, wrong, said[-300:].decode(errors='replace')))
            failures += 1
        n, count = n + step, count + 1
    print('%s: %s: %d calls failed in turn' % (name, call, count))
    if call in ('posix_spawn', 'kill') and name not in ('dcm', 'annotate') and not count:
        sys.exit('FAIL %s: no process of its own for foreign bytes' % name)


def render(size, series, *more):
    return [ctsplat, 'render', '--threads', '1', '--size', size, os.path.join(data, 'syntax', series), *more]


def test():
    png, dcm = ['-o', os.path.join(out, 'a.png')], ['-o', os.path.join(out, 'a.dcm')]
    rle = os.path.join(work, 'rle.dcm')
    jpeg_2000 = render('24x20', 'jpeg-2000', *png)
    compress = render('24x20', 'explicit', '--compress', 'jpeg-lossless', *dcm)
    run('info', all_step, [ctsplat, 'info', '--threads', '1', os.path.join(data, 'syntax/jpeg-ls')])
    run('deflated', all_step, [ctsplat, 'info', '--threads', '1', os.path.join(data, 'syntax/deflated')])
    subprocess.run(render('24x20', 'explicit', '--compress', 'rle', '-o', rle), check=True)
    run('compare', dcm_step, [ctsplat, 'compare', rle, rle])
    run('render', all_step, jpeg_2000 + ['-o', os.path.join(out, 'a.exr')])
    run('annotate', all_step, render('64x48', 'explicit', '--annotate', 'orientation,scale', *png))
    if call == 'kill': # and every process after it as well
        run('killed', all_step, jpeg_2000, CTS_FAIL_ON='1')
    run('dcm', dcm_step, render('24x20', 'explicit', *dcm))
    run('dcm', dcm_step, compress)
    if call == 'getrandom': # a site's key is made once
        state = os.path.join(work, 'state')
        key = render('24x20', 'explicit', '--deidentify', '--log', os.path.join(work, 'log'), *png)
        run('key', 1, ['sh', '-c', 'rm -rf "$XDG_STATE_HOME"; exec "$@"', 'sh', *key], XDG_STATE_HOME=state)
    if call == 'malloc': # in the programs that write, too: DCMTK crashes there
        run('encoder', all_step, compress, CTS_FAIL_CHILD='1')


try:
    os.mkdir(out)
    test()
finally:
    shutil.rmtree(work, ignore_errors=True)
sys.exit(failures > 0)
