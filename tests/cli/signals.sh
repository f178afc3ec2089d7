# SIGINT and SIGTERM: exit code 130, one line, nothing half-written, no temporary file.
command -v python3 >/dev/null && [ -r /proc/self/status ] || exit 77
interrupted=0
for name in INT TERM; do
    for wait in 0 0.1 0.4; do
        rm -rf o
        mkdir o
        last="render --rotation, SIG$name after $wait s"
        # A background process of a shell has SIGINT ignored; a subshell of its own resets that.
        python3 - "$ctsplat" "$data/phantom" $name $wait <<'PY' >out 2>err || fail "could not run it"
import os, signal, subprocess, sys, time
program, path, name, wait = sys.argv[1:]
run = subprocess.Popen([program, "render", path, "--rotation", "4000", "--size", "64x64", "-o", "o/a.png"])
number = getattr(signal, "SIG" + name)
# On a busy machine the program may not have come so far as to catch anything.
while run.poll() is None:
    caught = [line for line in open("/proc/%d/status" % run.pid) if line.startswith("SigCgt")]
    if caught and int(caught[0].split()[1], 16) >> (number - 1) & 1:
        break
    time.sleep(0.005)
while not os.listdir("o") and run.poll() is None: # a slow start must not meet the signal
    time.sleep(0.01)
time.sleep(float(wait))
run.send_signal(number)
print(run.wait(timeout=120))
PY
        code=$(cat out)
        [ "$code" = 130 ] || fail "exit code $code, expected 130"
        [ "$(cat err)" = "ctsplat: error: interrupted" ] || fail "expected one line (interrupted): $(cat err)"
        # Files with their final names are complete.
        for picture in o/*.png; do
            [ -e "$picture" ] || continue
            ok compare "$picture" "$picture"
        done
        [ -z "$(ls -A o | grep -v '^a-[0-9]*\.png$')" ] || fail "left behind: $(ls -A o | grep -v '^a-')"
        interrupted=$((interrupted + 1))
    done
done
[ $interrupted = 6 ] || fail "not all signals were tried"
