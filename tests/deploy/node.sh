#!/bin/bash
# ctsplat-node between a scanner and a PACS, on the loopback: node.sh SOURCE_ROOT CTSPLAT LOOPBACK_LIBRARY UNIT_FILTER
# Of its six studies, fifty with CTS_SOAK set, one is broken, one has a study UID that tries to leave the folder, and two
# are decoded and inflated by processes of their own. The PACS comes late, and the node is killed half way. It has the
# system calls that its unit leaves it, where systemd is there to say which these are.
set -u
root=$(realpath "$1") ctsplat=$(realpath "$2") library=$(realpath "$3") filter=$(realpath "$4") studies=6
[ -z "${CTS_SOAK-}" ] || studies=50
for program in storescp dcmsend dcmodify dcmdump setpriv flock; do
    command -v $program >/dev/null || { echo "skip: no $program"; exit 77; }
done
"$ctsplat" batch --help >/dev/null 2>&1 || { echo "skip: no batch in this build"; exit 77; }

work=$(mktemp -d)
cd "$work" || exit 1
node='' pacs=''
trap 'kill -9 $node $pacs 2>/dev/null; rm -rf "$work"' EXIT
fail()
{
    echo "FAIL: $*"
    tail -n 30 node.log
    exit 1
}
mkdir bin archive sent
ln -s "$ctsplat" bin/ctsplat
cp "$root/src/app/deploy/ctsplat-node" bin/
chmod +x bin/ctsplat-node
printf '#!/bin/sh\nLD_PRELOAD=%s exec %s "$@"\n' "$library" "$(command -v storescp)" >bin/storescp
chmod +x bin/storescp
export PATH=$work/bin:$PATH OMP_WAIT_POLICY=PASSIVE

free_port()
{
    python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])'
}
port=$(free_port) pacs_port=$(free_port)
cat >node.conf <<CONF
# A comment, a value with blanks, and one that must not be run.
CTSPLAT_NODE_DIR=$work/node
CTSPLAT_NODE_LISTEN=127.0.0.1:$port
CTSPLAT_NODE_ALLOW=*@127.0.0.1 FRIEND@192.0.2.0/24
CTSPLAT_NODE_PACS="ARCHIVE@127.0.0.1:$pacs_port"
CTSPLAT_NODE_OPTIONS=--presets bone --formats dcm --size 48x48 --threads 1
CTSPLAT_NODE_QUIET=2
CTSPLAT_NODE_RETRY=2
CTSPLAT_NODE_FREE=0
CTSPLAT_NODE_AET=\$(touch evil)
CONF

# study NUMBER FOLDER: its slices with UIDs of their own, in sent/NUMBER
study()
{
    cp -r "$2" "sent/$1"
    dcmodify -q -nb -gin -m "(0020,000D)=1.2.826.0.1.$1" -m "(0020,000E)=1.2.826.0.1.$1.1" "sent/$1"/*.dcm
}
for ((i = 1; i <= studies; i++)); do
    case $i in
    2) study $i "$root/testdata/geometry/mixed-patients" ;;
    4) study $i "$root/testdata/syntax/jpeg-2000" ;;
    5) study $i "$root/testdata/syntax/deflated" ;;
    *) study $i "$root/testdata/geometry/feet-first" ;;
    esac
done
dcmodify -q -nb -m '(0020,000D)=../../../evil;touch evil' -m '(0010,0010)=$(touch evil)^`id`' sent/3/*.dcm

send()
{
    dcmsend -nuc -aec '$(touch evil)' 127.0.0.1 "$port" "sent/$1"/*.dcm || fail "study $1 was not taken"
}
# calls WORD...: the system calls of names and groups
calls()
{
    local word
    for word in "$@"; do
        case $word in
        @*) calls $(sed -n "/^$word\$/,/^@/p" groups | sed '1d; /^@/d; s/#.*//') ;;
        *) echo "$word" ;;
        esac
    done
}
under=()
if command -v systemd-analyze >/dev/null; then
    systemd-analyze syscall-filter --no-pager >groups
    : >allowed
    while read -r line; do
        case $line in
        '~'*) calls ${line#?} | grep -vxFf - allowed >left; mv left allowed ;;
        *) calls $line >>allowed ;;
        esac
    done < <(sed -n 's/^SystemCallFilter=//p' "$root/src/app/deploy/ctsplat-node.service")
    under=(env ASAN_OPTIONS=detect_leaks=0 "$filter" allowed) # who looks for leaks calls ptrace, which the unit keeps away
    "${under[@]}" chroot / true 2>/dev/null && fail "the unit's filter keeps nothing away"
    "${under[@]}" true || fail "the unit's filter keeps everything away"
fi
start_node()
{
    "${under[@]}" bin/ctsplat-node node.conf >>node.log 2>&1 &
    node=$!
    for _ in $(seq 600); do
        grep -q 'is at work' node.log && echoscu -q -aec '$(touch evil)' 127.0.0.1 "$port" 2>/dev/null && return
        sleep 0.2
    done
    fail "the node does not listen"
}
captures()
{
    find archive -type f | wc -l
}
# wait_for SECONDS COMMAND...
wait_for()
{
    local left=$1
    shift
    until "$@"; do
        ((left-- > 0)) || fail "timed out waiting for: $*"
        kill -0 "$node" || fail "the node ended"
        sleep 1
    done
}
some_came() { [ "$(captures)" -ge 1 ]; }
all_done() { [ "$(find node/state -name 'ST_*' ! -name 'ST_9.*' | wc -l)" = "$studies" ]; }

# The PACS is not up yet: what is rendered waits for it. The receiver is killed, also while a batch waits for the PACS,
# and is there again.
start_node
kill_receiver()
{
    pkill -9 -P $node -f 'ctsplat receive' || fail "no receiver of the node's"
    wait_for "$1" echoscu -q -aec '$(touch evil)' 127.0.0.1 "$port"
}
batch_runs() { pgrep -P $node -f 'ctsplat batch' >pids; }
kill_receiver 120
half=$((studies / 2))
for ((i = 1; i <= half; i++)); do send $i; done
wait_for 120 batch_runs
kill_receiver 60
wait_for 120 grep -q 'tried again in' node.log
[ "$(grep -c 'starts again' node.log)" = 2 ] || fail "the receiver did not start again"
storescp --aetitle ARCHIVE --accept-all --output-directory archive "$pacs_port" >pacs.log 2>&1 &
pacs=$!
disown
wait_for 120 some_came
send $((half + 1))
kill -9 $node
wait $node 2>/dev/null
start_node
for ((i = half + 2; i <= studies; i++)); do send $i; done
wait_for $((120 + 10 * studies)) all_done
[ "$(captures)" = $((studies - 1)) ] || fail "$(captures) captures came, not $((studies - 1))"

# Captures join their studies; the broken one is reported.
for ((i = 1; i <= studies; i++)); do
    case $i in
    2) grep -q '"status": *"refused"' node/out/ST_1.2.826.0.1.2/batch.jsonl || fail "the broken study is not refused" ;;
    3) ;;
    *) grep -rlqa "1\.2\.826\.0\.1\.$i[^0-9.]" archive || fail "nothing came of study $i" ;;
    esac
done
[ -s node/out/index.html ] || fail "no contact sheet of all studies"

# A study with another series is rendered again, and only new captures are sent.
before=$(captures)
dcmodify -q -nb -gin -m '(0020,000E)=1.2.826.0.1.1.2' sent/1/*.dcm
send 1
more_came() { [ "$(captures)" -gt "$before" ]; }
wait_for 120 more_came
sleep 3
[ "$(captures)" = $((before + 1)) ] || fail "more than the new capture came"

# Old studies are removed: never finished ones, ones finished before more slices arrived, and remains of a killed purge.
for i in 1 2 4; do
    mkdir node/in/ST_9.$i
    echo 9 >node/tries/ST_9.$i
done
touch -d '10 days ago' node/state/ST_9.[24]
mkdir node/out/ST_9.3
touch -d '9 days ago' node/in/ST_9.[12]
old_went() { [ -z "$(find node -name 'ST_9.[123]')" ]; }
wait_for 60 old_went
[ -e node/in/ST_9.4 ] && all_done || fail "what is new was removed"
rm -r node/*/ST_9.4

# No file outside the folder, no command executed; a second node ends with a message; TERM ends the node and its
# listener.
[ -z "$(find . -name evil)" ] || fail "a name from outside was run or followed"
bin/ctsplat-node node.conf 2>second.log && fail "a second node runs in the same folder"
grep -q 'another ctsplat-node' second.log || fail "the error of a second node does not name the first one"
kill -TERM $node
wait $node || fail "TERM: exit status $?"
echoscu -q -aec '$(touch evil)' 127.0.0.1 "$port" 2>/dev/null && fail "the listener outlives the node"
node=''
echo "$studies studies, $(captures) captures"
