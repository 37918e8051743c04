#!/bin/bash
# Does a study that Slurm extracts in shards, with a node killed in the middle, become the same file as on one machine?
#
#     experiments/scale/slurm.sh [--study STUDY] [--keep]
#
# Starts a Slurm of its own on this machine, one controller and two nodes of two cores each, in a temporary folder. Submits
# extract.sbatch as a user does, waits for the first shard, and kills a node that runs another: slurmd, slurmstepd and vernis, with
# kill -9. When the controller has put the shard back into the queue, the node returns. In the end the merged shards must have the
# bytes of `vernis extract` without --shard, which has a cache of its own.
#
#   --study STUDY   as of `vernis extract`; the default, synthetic, is embedded in the program and needs no data.
#                   lavoue2021-open is found where the variable VERNIS_DATA says
#   --keep          keeps the temporary folder, with all logs
#
# The program is `vernis` in PATH, or what the variable VERNIS names. Needs the Debian packages slurm-wlm and munge, and no root;
# what else of Slurm runs on this machine is not touched. Two nodes on one machine show that the result is right, not how fast it is.
set -euo pipefail

fail() { echo "slurm.sh: $*" >&2; exit 1; }
say() { printf '%4d s  %s\n' "$SECONDS" "$*"; }

study=synthetic keep=
while [ $# -gt 0 ]; do
    case $1 in
        --study) study=${2:?--study needs the name of a study}; shift 2 ;;
        --keep) keep=yes; shift ;;
        *) fail "unknown argument $1; see the first lines of this file" ;;
    esac
done
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
PATH=$PATH:/usr/sbin:/sbin
for tool in munged slurmctld slurmd sbatch squeue scontrol; do
    command -v $tool > /dev/null || fail "$tool is missing; on Debian: apt-get install slurm-wlm munge"
done
vernis=$(command -v "${VERNIS:-vernis}") || fail "there is no program ${VERNIS:-vernis}; put vernis into PATH, or name it in VERNIS"
if [ -f "$study" ]; then study=$(realpath "$study"); fi
if [ -n "${VERNIS_DATA:-}" ]; then VERNIS_DATA=$(realpath "$VERNIS_DATA"); export VERNIS_DATA; fi
# What an outer Slurm job or the user's settings say does not hold here.
unset "${!SLURM@}" "${!SBATCH@}" "${!SQUEUE@}"

work=$(mktemp -d --tmpdir vernis-slurm.XXXXXX)
mkdir "$work"/{bin,munge,state,node1,node2}
ln -s "$(realpath "$vernis")" "$work/bin/vernis"
export PATH=$work/bin:$PATH SLURM_CONF=$work/slurm.conf

# The process of the task that runs on a node: extract.sbatch becomes vernis by `exec`.
task_on() {
    local process
    for process in $(pgrep -x vernis); do
        if tr '\0' '\n' 2> /dev/null < "/proc/$process/environ" |
            grep -cxF -e "SLURM_CONF=$SLURM_CONF" -e "SLURMD_NODENAME=$1" | grep -qx 2; then
            echo "$process"
        fi
    done
}
# slurmd, slurmstepd (the parent of the task) and the task of a node. slurmd comes first, so that it tells nobody.
processes_of() {
    local task
    cat "$work/$1.pid" 2> /dev/null || true
    for task in $(task_on "$1"); do
        awk '$1 == "PPid:" && $2 > 1 { print $2 }' "/proc/$task/status" 2> /dev/null || true
        echo "$task"
    done
}
clean_up() {
    local code=$? process file
    if [ -n "${job:-}" ]; then scancel "$job" 2> /dev/null || true; fi
    for process in $(processes_of node1) $(processes_of node2); do kill -9 "$process" 2> /dev/null || true; done
    for file in slurmctld munge/munged; do
        process=$(cat "$work/$file.pid" 2> /dev/null) || continue
        kill "$process" 2> /dev/null || true
        for _ in $(seq 50); do kill -0 "$process" 2> /dev/null || break; sleep 0.1; done
    done
    if [ -n "$keep" ]; then echo "kept: $work"; else rm -rf "$work"; fi
    exit $code
}
trap clean_up EXIT
trap 'exit 130' INT
trap 'exit 143' TERM

# Three ports of this machine on which nobody listens.
first=20000
while for port in $first $((first + 1)) $((first + 2)); do (: < "/dev/tcp/127.0.0.1/$port") 2> /dev/null && break; done; do
    first=$((first + 10))
done
host=$(hostname -s)
cat > "$SLURM_CONF" << END
ClusterName=vernis
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$first
SlurmUser=$(id -un)
SlurmdUser=$(id -un)
# A message of Slurm is valid for cred_expire seconds; so long a task that is queued again waits before it starts.
AuthType=auth/munge
AuthInfo=socket=$work/munge/socket,cred_expire=10
# A node that has been silent for so many seconds is down.
SlurmdTimeout=10
# A node that was down may work again as soon as it answers.
ReturnToService=2
# Tasks that have ended are shown until the end.
MinJobAge=86400
KillWait=5
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/%n
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/%n.pid
SlurmctldLogFile=$work/slurmctld.log
SlurmdLogFile=$work/%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
# Nodes have what is said here, whatever the machine has.
SlurmdParameters=config_overrides
NodeName=node1 NodeHostname=$host NodeAddr=127.0.0.1 Port=$((first + 1)) CPUs=2 RealMemory=4096
NodeName=node2 NodeHostname=$host NodeAddr=127.0.0.1 Port=$((first + 2)) CPUs=2 RealMemory=4096
PartitionName=all Nodes=ALL Default=YES
END

# Waits until a command succeeds.
wait_for() {
    local seconds=$1 what=$2 end=$((SECONDS + $1))
    shift 2
    until "$@"; do
        if [ $SECONDS -ge $end ]; then
            tail -n 5 "$work"/{slurmctld,node1,node2}.log >&2 || true
            fail "after $seconds s: $what"
        fi
        sleep 0.5
    done
}

(umask 077 && head -c 1024 /dev/urandom > "$work/munge/key")
# --force: the folders above a temporary folder may be open to others; the key is not.
munged --force --socket="$work/munge/socket" --key-file="$work/munge/key" --pid-file="$work/munge/munged.pid" \
    --log-file="$work/munge/munged.log" --seed-file="$work/munge/seed" 2> /dev/null || fail "munged does not start"
slurmctld || fail "slurmctld does not start"
for node in node1 node2; do slurmd -N $node || fail "slurmd of $node does not start"; done
nodes_idle() { [ "$(sinfo -h -N -t idle -o %N 2> /dev/null | wc -l)" = 2 ]; }
wait_for 60 "the nodes do not answer the controller" nodes_idle
say "$(slurmctld -V): a controller, node1 and node2 on this machine"

cd "$work"
job=$(sbatch --parsable "$here/extract.sbatch" --study "$study" --cache "$work/cache" --out "$work/shards")
count=$(sed -n 's/^#SBATCH --array=1-\([0-9]*\)$/\1/p' "$here/extract.sbatch")
say "job $job: $study in $count shards"

# The file of a shard, once it is written.
shard_file() { compgen -G "$work/shards/*-$(printf "%0${#count}d" "$1")-of-$count.parquet"; }
# A node that runs a shard while another is done, as "shard node process".
victim=
find_victim() {
    compgen -G "$work/shards/*.parquet" > /dev/null || return 1
    local shard node task
    while read -r shard node; do
        task=$(task_on "$node")
        if [ -n "$task" ] && ! shard_file "$shard" > /dev/null; then victim="$shard $node $task" && return 0; fi
    done < <(squeue -h -j "$job" -t R -o '%K %N' | sort -k2r)
    return 1
}
all_ended() { [ -z "$(squeue -h -j "$job" 2> /dev/null)" ]; }
victim_or_end() { find_victim || all_ended; }
wait_for 86400 "no shard is done" victim_or_end
if [ -z "$victim" ]; then
    tail -q -n 2 vernis-extract-*.log | sort -u | head -n 5 >&2
    fail "the job ended before a node was killed: a shard failed, or shards are too short"
fi
read -r shard node task <<< "$victim"
# shellcheck disable=SC2046
kill -9 $(processes_of "$node")
killed=$SECONDS
say "$node, which runs shard $shard (process $task), is killed; $(find shards -name '*.parquet' | wc -l) of $count shards are done"
if shard_file "$shard" > /dev/null; then fail "shard $shard was done before the kill: run the script again"; fi
# Work that is kept is not done again: these files stay as they are.
cached() { find "$work/cache" -type f ! -name '.*' -printf '%P %T@\n' | sort; }
cached > cached-before

# Of a shard: a word that `scontrol show job` says about it.
about() { scontrol show job "${job}_$1" -o | grep -o "\b$2=[^ ]*" | cut -d= -f2; }
requeued() { [ "$(about "$shard" Restarts)" != 0 ]; }
wait_for 300 "the controller did not put shard $shard back into the queue" requeued
say "the controller noticed after $((SECONDS - killed)) s and put shard $shard back into the queue"
slurmd -N "$node" || fail "slurmd of $node does not start again"
say "$node returns"

wait_for 86400 "the job did not end" all_ended
scontrol show job "$job" -o > tasks
if [ "$(grep -c ' JobState=COMPLETED ' tasks)" != "$count" ]; then
    tail -q -n 2 vernis-extract-*.log | sort -u | head -n 5 >&2
    fail "some of the $count shards failed: $(grep -v ' JobState=COMPLETED ' tasks | grep -o 'ArrayTaskId=[^ ]*\|JobState=[^ ]*' | tr '\n' ' ')"
fi
restarted=$(grep -c ' Restarts=[1-9]' tasks) || fail "no task was queued again: the kill hit nothing"
say "all $count shards are done; shard $shard ran again on $(about "$shard" BatchHost)"
cached > cached-after
again=$(comm -23 cached-before cached-after | wc -l)

vernis merge shards/*.parquet --out merged/merged.parquet
say "merged"
vernis extract --study "$study" --cache "$work/cache-of-one" --out "$work/one" 2> one.log || { cat one.log >&2; fail "vernis extract failed"; }
say "extracted without shards"
cmp merged/merged.parquet one/*.parquet || fail "the merged file differs from that of an unsharded run"

echo
echo "shards $count, tasks queued again $restarted ($(grep -c 'requeue job .* due to failure of node' slurmctld.log) in the controller's log)"
echo "cached files at the kill $(wc -l < cached-before), of these written again $again"
echo "merged and unsharded file: equal, $(wc -c < merged/merged.parquet) bytes, SHA-256 $(sha256sum < merged/merged.parquet | cut -c1-16)"
