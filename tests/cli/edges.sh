# The edges of a process: what it inherits, what is taken away under it, what lies beside good files.
draw='--size 24x20 --threads 1'

# Started with SIGCHLD ignored, a batch ends all the same.
last="batch with SIGCHLD ignored"
code=0
timeout 120 python3 -c 'import os, signal, sys
signal.signal(signal.SIGCHLD, signal.SIG_IGN)
os.execv(sys.argv[1], sys.argv[1:])' "$ctsplat" batch "$data/syntax/explicit" -O ignored $draw >out 2>err || code=$?
[ $code = 0 ] || fail "exit code $code, expected 0"

# Started without standard files: no message gets into a file of the batch, and output that has no place is an error.
last="closed descriptors"
code=0
timeout 120 "$ctsplat" batch "$data/syntax/explicit" -O closed $draw <&- >&- 2>&- || code=$?
[ $code = 0 ] || fail "exit code $code, expected 0"
python3 -c 'import json, sys
for line in open(sys.argv[1]): json.loads(line)' closed/batch.jsonl || fail "words in the journal"
code=0
"$ctsplat" presets >&- 2>err || code=$?
[ $code = 5 ] || fail "exit code $code of output without a place, expected 5"

# A removed lock excludes no other batch: the one that had it gives up, and another one finishes its work.
mkdir many
for i in 1 2 3 4 5 6 7 8 9; do
    cp -r "$data/syntax/explicit" many/$i
    python3 - many/$i $i <<'PY'
import glob, sys
folder, i = sys.argv[1:]
for path in glob.glob(folder + '/*'):
    data = bytearray(open(path, 'rb').read())
    at = data.index(b'\x20\0\x0e\0UI') + 6
    n = data[at]
    uid = data[at + 2:at + 2 + n].rstrip(b'\0')
    data[at + 2 + len(uid) - 1] = ord(i)
    open(path, 'wb').write(data)
PY
done
last="batch whose lock is removed"
"$ctsplat" batch many -O unlocked --size 1500x1500 --rotation 40 --jobs 1 --threads 1 >out 2>err &
batch=$!
while [ ! -e unlocked/batch.jsonl ] && kill -0 $batch 2>/dev/null; do sleep 0.02; done
rm unlocked/.batch.lock
code=0
wait $batch || code=$?
[ $code = 1 ] && has err 'lock was removed' || fail "exit code $code, expected 1 and the reason"

# Dangling links and unreadable files are reported and counted; the good series beside them is rendered.
cp -r "$data/syntax/explicit" beside
ln -s nowhere beside/zz.dcm
head -c 250 "$(ls "$data"/syntax/explicit/* | head -n 1)" >beside/cut.dcm
printf 'PK\003\004zip' >beside/more.zip
ok batch beside -O made $draw
has err '1 of 1 series done'
has err 'files that cannot be read: 2'
has err 'packed files that are not looked into: 1'

# A UID with a control character is not another one without it.
cp -r "$data/syntax/explicit" torn
python3 - torn <<'PY'
import glob, sys
for path in glob.glob(sys.argv[1] + '/*'):
    data = bytearray(open(path, 'rb').read())
    data[data.index(b'\x20\0\x0e\0UI') + 8 + 5] = 10
    open(path, 'wb').write(data)
PY
refused 3 'no CT, MR or PET slice' info torn
refused 3 'UID \(0020,000E\) holds control' render torn -o torn.png

# Captures with a patient's identity are private; a picture and a de-identified capture follow the umask.
(
    umask 0
    ok render "$data/syntax/explicit" $draw -o a.png -o a.dcm --write-state s.dcm
    ok render "$data/syntax/explicit" $draw -o b.dcm --deidentify
)
modes=$(stat -c %a a.png a.dcm s.dcm b.dcm | tr '\n' ' ')
[ "$modes" = "666 640 640 666 " ] || fail "modes are $modes"

# Options for DICOM outputs cause a warning where there is none; de-identification covers a batch's folders, too.
ok batch "$data/syntax/explicit" -O unnamed $draw --deidentify --series-number 7
has err 'series-number acts on .*dcm outputs'
! grep -q "deidentify acts on" err || fail "--deidentify acts on a batch without DICOM outputs, too"

# A small stack (ulimit -s) changes nothing.
last="a stack of 256 KiB"
code=0
"$ctsplat" render "$data/phantom" $draw -o usual.png || fail "no picture"
(
    ulimit -s 256
    "$ctsplat" render "$data/phantom" --size 24x20 --threads 2 -o small.png -o small.exr -o small.dcm &&
        "$ctsplat" batch "$data/syntax/explicit" -O small $draw
) >out 2>err || code=$?
[ $code = 0 ] || fail "exit code $code, expected 0: $(cat err)"
cmp usual.png small.png || fail "another picture"
