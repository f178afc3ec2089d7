"""The program that talks to peers ends with the command that started it, however that ends; a missing one is named."""
import os
import signal
import socket
import subprocess
import sys
import time

ctsplat, loopback, data = os.path.abspath(sys.argv[1]), sys.argv[2], sys.argv[3]
os.makedirs('tmp')
environment = dict(os.environ, TMPDIR=os.path.abspath('tmp'))


def children(pid):
    """The programs that the process has started."""
    found = []
    for other in filter(str.isdigit, os.listdir('/proc')):
        try:
            with open('/proc/%s/stat' % other) as f:
                name, _, rest = f.read().rpartition(')')
        except OSError:
            continue
        if rest.split()[1] == str(pid) and rest.split()[0] != 'Z':
            found.append((int(other), name.partition('(')[2]))
    return found


def wait_for(condition, what, seconds=20):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, what
        time.sleep(0.02)


silent = socket.create_server(('127.0.0.1', 0)) # never answers
port = silent.getsockname()[1]
commands = {'fetch': ['render', '--study-uid', '1.2.3', '-o', 'none.png'], 'find': ['info', '--patient-id', 'x'],
            'batch': ['batch', '--patient-id', 'x', '-O', 'none']}
for peer in ('NOBODY@127.0.0.1:%d' % port, 'http://127.0.0.1:%d/rs' % port):
    for name, words in commands.items():
        for what, code in ((signal.SIGKILL, -9), (signal.SIGINT, 130), (signal.SIGTERM, 130), ('child', 1)):
            process = subprocess.Popen([ctsplat, *words, '--from', peer], stderr=subprocess.PIPE, text=True, env=environment)
            held = silent.accept()[0]
            wait_for(lambda: children(process.pid), 'no program is started')
            (child, program), = children(process.pid)
            assert program == 'ctsplat-net', program
            if what == 'child':
                os.kill(child, signal.SIGKILL)
            else:
                process.send_signal(what)
            start = time.monotonic()
            said = process.communicate(timeout=20)[1]
            case = (peer, name, what, process.returncode, said)
            assert process.returncode == code and time.monotonic() - start < 10, case
            assert ('ended unexpectedly' in said) == (what == 'child'), case
            wait_for(lambda: not os.path.exists('/proc/%d' % child) or 'ctsplat-net' not in open('/proc/%d/comm' % child).read() or
                     ') Z ' in open('/proc/%d/stat' % child).read(), ('an orphan is left', case))
            held.close()
            assert what == signal.SIGKILL or not os.listdir('tmp'), case

os.makedirs('empty')
done = subprocess.run([ctsplat, 'info', '--from', 'http://127.0.0.1:%d/rs' % port, '--patient-id', 'x'], capture_output=True,
                      text=True, env=dict(environment, CTSPLAT_LIBEXEC=os.path.abspath('empty')))
assert done.returncode == 1 and 'ctsplat-net is not in the folder of CTSPLAT_LIBEXEC' in done.stderr, done
