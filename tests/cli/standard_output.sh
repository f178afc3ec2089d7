# -o -: one whole picture through a pipe, in every format, and nothing of it where it cannot be.
export TMPDIR="$work/tmp"
mkdir tmp
small="--size 40x30 -p skin"
SOURCE_DATE_EPOCH=1700000000
export SOURCE_DATE_EPOCH
for format in png exr dcm; do
    ok render "$data/phantom" $small -o file.$format
    "$ctsplat" render "$data/phantom" $small -o - --format $format --log - </dev/null 2>err | cat >piped
    cmp file.$format piped || fail "$format through a pipe differs from the file"
    has err "\"event\":\"output\".*\"path\":\"-\",\"format\":\"$format\",\"bytes\":$(wc -c <piped)}"
    has err '"command":"render .*-o - --format '
    has err '"event":"done"'
    grep -q ctsplat- err && fail "the log names a temporary file"
done
# Beside a file, and a rotation where one file holds it.
ok render "$data/phantom" $small -o - --format exr -o beside.png
cmp out file.exr && cmp beside.png file.png || fail "beside a file the pictures differ"
ok render "$data/phantom" $small -o - --format dcm --rotation 3
cp out turned.dcm
ok render "$data/phantom" $small -o whole.dcm --rotation 3
cmp turned.dcm whole.dcm || fail "a rotation through a pipe differs from the file"
ok render "$data/phantom" $small -o - --format png --explain
has out '^preset skin'
[ -z "$(ls -A tmp)" ] || fail "left behind: $(ls -A tmp)"

refused 2 '-o -: has no ending .*--format' render "$data/phantom" $small -o -
refused 2 '--format png: .* no output is -' render "$data/phantom" $small -o x.png --format png
refused 2 '--format bmp: not one of: png exr dcm' render "$data/phantom" $small -o - --format bmp
refused 2 'given twice' render "$data/phantom" $small -o - -o - --format png
refused 2 'holds one picture' render "$data/phantom" $small -o - --format png --rotation 3
refused 2 'no DICOM output to send' render "$data/phantom" $small -o - --format dcm --send A@localhost:1
refused 3 'nowhere' render nowhere -o - --format png

# A full disk and a closed pipe are errors. (progress.sh checks that a terminal gets no binary data.)
if [ -w /dev/full ]; then
    last="render -o - >/dev/full" code=0
    "$ctsplat" render "$data/phantom" $small -o - --format png --log log >/dev/full 2>err || code=$?
    [ $code = 5 ] || fail "exit code $code, expected 5"
    has err '^ctsplat: error: standard output: '
    [ "$(wc -l <err)" = 1 ] || fail "expected one line: $(cat err)"
    tail -1 log | grep -q '"failed".*"exit_code":5' || fail "the last line of the log is not the failure: $(tail -1 log)"
fi
TMPDIR="$work/none" run render "$data/phantom" $small -o - --format png
[ "$code" = 5 ] && [ ! -s out ] || fail "no folder for the picture: exit code $code"
has err 'TMPDIR'

# A signal leaves no temporary file, during the reading of the input or later.
for wait in 0 0.02 0.05 0.1 0.3; do
    "$ctsplat" render "$data/phantom" --size 3000x3000 -o - --format png >out 2>err &
    n=0
    while [ -z "$(ls -A tmp)" ] && [ $n -lt 1000 ]; do
        sleep 0.01
        n=$((n + 1))
    done
    [ -n "$(ls -A tmp)" ] || fail "no temporary folder to wait for"
    sleep $wait
    kill -TERM $! 2>/dev/null
    code=0
    wait $! || code=$?
    [ $code = 130 ] && [ ! -s out ] || [ $code = 0 ] || fail "exit code $code after a signal"
    [ -z "$(ls -A tmp)" ] || fail "a signal left behind: $(ls -A tmp)"
done
