"""stages.py LOG ENGINE VERIFIED OUTPUT...: the log of one render as ctsplat(1), TIMING LOG, has it."""
import json
import os
import sys

from pictures import check

STAGES = 'scan labels decode grey classify occlusion footprint splat composite shade warp export'.split()

with open(sys.argv[1]) as f:
    events = [json.loads(line) for line in f]


def all_of(kind):
    return [e for e in events if e['event'] == kind]


check(all(set(e) >= {'event', 't_ms'} for e in events), 'an object without event or t_ms')
times = [e['t_ms'] for e in events]
check(times == sorted(times) and times[0] >= 0, 'time runs backwards')
check(events[-1]['event'] == 'done' and len(all_of('done')) == 1, 'the last event is not the only done')
done = events[-1]
for key in 'wall_ms', 'cpu_ms', 'peak_rss_bytes', 'threads':
    check(done[key] > 0, 'done without ' + key)

stages = {e['stage']: e for e in all_of('stage')}
check(len(stages) == len(all_of('stage')), 'a stage twice')
check(set(stages) <= set(STAGES), 'unknown stages: %s' % set(stages))
for name in 'scan', 'decode', 'export':
    check(name in stages, 'no stage ' + name)
for e in stages.values():
    check(set(e) >= {'wall_ms', 'cpu_ms', 'items', 'bytes'} and e['wall_ms'] >= 0, 'stage %s' % e)
missing = [s for s in STAGES if s not in stages]
skipped = ' '.join(e['what'] + ' ' + e['why'] for e in all_of('skipped'))
check(all(e['what'] and e['why'] for e in all_of('skipped')), 'skipped without what or why')
check(not missing or skipped, 'stages %s did not run and nothing says why' % missing)
total = sum(e['wall_ms'] for e in stages.values())
check(abs(total - done['wall_ms']) <= 0.05 * done['wall_ms'],
      'stages add up to %.1f of %.1f ms' % (total, done['wall_ms']))

voxels = all_of('voxels')
check(len(voxels) == (sys.argv[2] != 'raycast'), 'voxels: %s' % voxels)  # the ray caster has none to count
for e in voxels:
    check(e['total'] == 64 * 64 * 48, 'voxels: %s' % e)
    check(all(0 <= e[k] <= e['total'] for k in ('void', 'reused', 'splatted')), 'voxels: %s' % e)

verified = int(sys.argv[3])
error = all_of('error')
check(len(error) == (verified > 0), 'error: %s' % error)
for e in error:
    check(e['pixels'] == verified and 0 <= e['rmse'] <= e['max'] < 0.5 and 'psnr_db' in e, 'error: %s' % e)

outputs = all_of('output')
check([e['path'] for e in outputs] == sys.argv[4:], 'outputs: %s' % outputs)
for e in outputs:
    check(e['format'] == e['path'].rsplit('.', 1)[1], 'format: %s' % e)
    check(e['bytes'] == os.path.getsize(e['path']), 'bytes: %s' % e)
check('Phantom' not in open(sys.argv[1]).read() and 'PHANTOM' not in open(sys.argv[1]).read(), 'patient data')
