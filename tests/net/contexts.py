"""A peer that takes no presentation context: the message names class and syntax, and the option that helps.

contexts.py CTSPLAT LOOPBACK SERIES"""
import os
import subprocess
import sys

import peers

ctsplat, loopback, data = os.path.abspath(sys.argv[1]), sys.argv[2], sys.argv[3]
peers.need('storescp')

with open('peer.cfg', 'w') as f:
    f.write('[[TransferSyntaxes]]\n[Plain]\nTransferSyntax1 = LittleEndianExplicit\n[[PresentationContexts]]\n[Only]\n'
            'PresentationContext1 = VerificationSOPClass\\Plain\n'
            'PresentationContext2 = SecondaryCaptureImageStorage\\Plain\n'
            '[[Profiles]]\n[Narrow]\nPresentationContexts = Only\n')
port = peers.free_port()
os.mkdir('inbox')
process = subprocess.Popen(['storescp', '--aetitle', 'ARCHIVE', '-od', 'inbox', '--config-file', 'peer.cfg', 'Narrow',
                            str(port)], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                           stderr=subprocess.DEVNULL, env=dict(os.environ, LD_PRELOAD=loopback))
peers.wait_for_port(port, process)
peer = 'ARCHIVE@127.0.0.1:%d' % port


def render(code, *words):
    done = subprocess.run([ctsplat, 'render', '--size', '32x32', '--force', *words], stdin=subprocess.DEVNULL,
                          capture_output=True, text=True, env=dict(os.environ, LD_PRELOAD=loopback))
    assert done.returncode == code, (words, done.returncode, done.stderr)
    return done.stderr


try:
    render(0, data, '-o', 'a.dcm', '--send', peer)
    said = render(5, data, '-o', 'a.dcm', '--send', peer, '--compress', 'rle')
    assert '1.2.840.10008.5.1.4.1.1.7)' in said and '1.2.840.10008.1.2.5)' in said and '--compress none' in said, said
    said = render(5, data, '-o', 'a.dcm', '--send', peer, '--rotation', '3')
    assert '1.2.840.10008.5.1.4.1.1.7.4)' in said and '1.2.840.10008.1.2.1)' in said, said
    assert '--compress' not in said and 'set up to store this class' in said, said
    said = render(3, '-o', 'a.png', '--from', peer, '--study-uid', '1.2.3')
    assert '--move-port' in said, said
    said = render(3, '-o', 'a.png', '--from', peer, '--study-uid', '1.2.3', '--move-port', str(peers.free_port()))
    assert '1.2.840.10008.5.1.4.1.2.2.2)' in said and 'DICOMweb' in said, said
finally:
    process.kill()
    process.wait()
