#!/bin/bash
# ctsplat.sbatch on a real Slurm, one slurmctld and two nodes on the loopback: slurm.sh SOURCE_ROOT CTSPLAT
# Eight array tasks; one node loses its power while it works. All series are done once, and the same bytes come out as
# on one machine. Needs root: each node is a process namespace, so that its tasks die with it.
set -u
export PATH=$PATH:/usr/sbin:/sbin
[ -n "${CTS_SOAK-}" ] || { echo "skip: takes minutes; ./dev soak runs it"; exit 77; }
root=$(realpath "$1") ctsplat=$(realpath "$2")
for program in slurmctld slurmd sbatch munged unshare dcmodify; do
    command -v $program >/dev/null || {
        echo "skip: no $program (packages slurmctld slurmd slurm-client munge)"
        exit 77
    }
done
[ "$(id -u)" = 0 ] || { echo "skip: not root"; exit 77; }
unshare --pid --fork --mount-proc true 2>/dev/null || { echo "skip: no process namespaces here"; exit 77; }
"$ctsplat" batch --help >/dev/null 2>&1 || { echo "skip: no batch in this build"; exit 77; }

work=$(mktemp -d)
chmod 755 "$work"
cd "$work" || exit 1
started=()
# power_cut PID: unshare's only child process is the namespace's init, whose end kills all processes in it
power_cut()
{
    kill -9 $(cat "/proc/$1/task/$1/children" 2>/dev/null) "$1" 2>/dev/null
}
end()
{
    for pid in "${started[@]}"; do power_cut "$pid"; done
    [ ! -s munge/pid ] || kill "$(cat munge/pid)"
    sleep 1
    cd / && rm -rf "$work"
}
trap end EXIT
fail()
{
    echo "FAIL: $*"
    tail -n 5 slurmctld.out log.* 2>/dev/null
    squeue -r -t all 2>/dev/null | head -20
    exit 1
}
# wait_for SECONDS COMMAND...
wait_for()
{
    local left=$1
    shift
    until "$@"; do
        ((left-- > 0)) || fail "timed out waiting for: $*"
        sleep 1
    done
}

port=$(python3 -c '
import socket
for p in range(20000, 30000, 4):
    try:
        for s in [socket.socket() for i in range(3)]:
            s.bind(("127.0.0.1", p)); p += 1; s.close()
    except OSError:
        continue
    print(p - 3)
    break')
mkdir munge state bin spool.n1 spool.n2
chmod 700 munge
(umask 077 && head -c 1024 /dev/urandom >munge/key)
munged --force --key-file="$work/munge/key" --socket="$work/munge.sock" --pid-file="$work/munge/pid" \
    --log-file="$work/munge/log" --seed-file="$work/munge/seed" || { echo "skip: munged does not start"; exit 77; }
cat >slurm.conf <<CONF
ClusterName=test
SlurmctldHost=localhost(127.0.0.1)
SlurmctldPort=$port
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket=$work/munge.sock,cred_expire=5
CredType=cred/munge
CommunicationParameters=NoAddrCache,NoInAddrAny,NoCtldInAddrAny
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool.%n
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd.%n.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
MpiDefault=none
SchedulerType=sched/backfill
SchedulerParameters=sched_interval=2,bf_interval=2,batch_sched_delay=1
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
JobRequeue=1
ReturnToService=2
SlurmdTimeout=4
KillWait=2
NodeName=n[1-2] NodeHostname=localhost NodeAddr=127.0.0.1 Port=$((port + 1))-$((port + 2)) CPUs=2 RealMemory=1000
PartitionName=main Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
export SLURM_CONF=$work/slurm.conf
slurmctld -D -i >slurmctld.out 2>&1 &
started+=($!)
disown
for node in n1 n2; do
    unshare --pid --fork --kill-child --mount-proc slurmd -D -N $node >slurmd.$node.out 2>&1 &
    started+=($!)
    disown
done
n2=${started[2]}
both_idle() { [ "$(sinfo -h -t idle -o %D 2>/dev/null)" = 2 ]; }
wait_for 60 both_idle

# 24 series of one's own UIDs, one of them refused.
ln -s "$ctsplat" bin/ctsplat
export PATH=$work/bin:$PATH SOURCE_DATE_EPOCH=1700000000
options=(--presets bone,skin --views anterior,left --formats png,dcm --size 768x768)
for i in $(seq 24); do
    source=$root/testdata/phantom
    [ "$i" != 7 ] || source=$root/testdata/geometry/mixed-patients
    mkdir -p archive
    cp -r "$source" "archive/$i"
    dcmodify -q -nb -m "(0020,000D)=1.2.826.0.1.$i" -m "(0020,000E)=1.2.826.0.1.$i.1" "archive/$i"/*.dcm
done
ctsplat batch "$work/archive" -O "$work/alone" "${options[@]}" 2>/dev/null
[ $? = 8 ] || fail "the batch on one machine does not end with 8"

# With the manual's command and the file's own resources, which fit these nodes.
job=$(sbatch --parsable --array=0-7 -o "$work/log.%A_%a" "$root/src/app/deploy/ctsplat.sbatch" \
    "$work/archive" -O "$work/together" "${options[@]}") || fail "sbatch"
on_n2() { [ "$(squeue -h -r -t running -w n2 -j "$job" -o %i | wc -l)" -gt 0 ] && sleep 1; }
wait_for 60 on_n2
lost=$(squeue -h -r -t running -w n2 -j "$job" -o %i | tr '\n' ' ')
power_cut "$n2"
scontrol update nodename=n2 state=down reason=power
echo "power cut with tasks $lost"
ended() { [ -z "$(squeue -h -r -j "$job" -t pending,running,completing -o %i)" ]; }
wait_for 600 ended
[ -n "$lost" ] || fail "no task ran on the node that was cut"
for task in $lost; do
    scontrol show job "$task" | grep -q 'Restarts=[1-9]' || fail "task $task was not started again"
done

ctsplat batch --merge "$work/together" || fail "merge"
[ -s together/index.html ] || fail "no contact sheet"
python3 - alone together <<'PY' || fail "the cluster's work is not that of one machine"
import glob, json, sys
runs = []
for folder in sys.argv[1:]:
    lines = [json.loads(line) for path in glob.glob(folder + '/batch*.jsonl') for line in open(path)]
    uids = [line['series_uid'] for line in lines]
    assert len(uids) == len(set(uids)) == 24, 'series: %d lines of %d series' % (len(uids), len(set(uids)))
    runs.append({line['series_uid']: (line['status'], line['reason'],
                                      sorted((o['path'], o['sha256']) for o in line['outputs'])) for line in lines})
assert runs[0] == runs[1], 'journals differ'
assert sum(status == 'done' for status, reason, outputs in runs[0].values()) == 23
PY
# files FOLDER: what was rendered there
files()
{
    (cd "$1" && find . -type f ! -name 'batch*' ! -name index.html ! -name '.*' | LC_ALL=C sort)
}
(cd alone && files . | xargs sha256sum) >alone.sums
(cd together && sha256sum --quiet -c ../alone.sums) || fail "files differ"
[ "$(files alone)" = "$(files together)" ] || fail "there are other files than on one machine"
[ -z "$(find together -name '*.tmp')" ] || fail "temporary files were left"

# Near its time limit a task is queued again, and then has nothing left to do.
rm -rf "$work/together"
job=$(sbatch --parsable --array=0-0 --cpus-per-task=1 --mem=0 -o "$work/log.%A_%a" "$root/src/app/deploy/ctsplat.sbatch" \
    "$work/archive" -O "$work/together" "${options[@]}") || fail "sbatch"
begun() { compgen -G "$work/together/batch*.jsonl" >/dev/null; }
wait_for 60 begun
scancel --batch --signal=USR1 "${job}_0"
wait_for 600 ended
scontrol show job "${job}_0" | grep -q 'Restarts=[1-9]' || fail "the task did not go back into the queue"
(cd together && sha256sum --quiet -c ../alone.sums) || fail "files differ after the time limit"

# afterok begins where nothing was refused: what is no volume passes.
rm -rf archive/7
cp -r "$root/testdata/geometry/one-slice" archive/one
job=$(sbatch --parsable --array=0-1 -o "$work/log.%A_%a" "$root/src/app/deploy/ctsplat.sbatch" \
    "$work/archive" -O "$work/whole" --size 64x64) || fail "sbatch"
sbatch --dependency=afterok:"$job" -o "$work/log.merge" --wrap "ctsplat batch --merge '$work/whole'" >merge.job ||
    fail "sbatch afterok"
wait_for 300 test -s whole/index.html
grep -q '"status":"thumbnail"' whole/batch-*.jsonl || fail "no thumbnail"
echo "24 series, 8 tasks, one power cut, afterok"
