#!/bin/sh
# A Slurm of one node, this machine, for the soak tests of job arrays and clusters: `make slurm`, as root.
# It installs Debian's packages slurm-wlm and munge where they are missing, writes /etc/slurm/slurm.conf, adds the host's name to
# /etc/hosts, and starts munged, slurmctld and slurmd. Nothing ends them but `tests/slurm/one_node.sh stop`, or a restart.
set -eu

[ "$(id -u)" -eq 0 ] || { echo "one_node.sh: this must be run as root" >&2; exit 1; }

stop() {
    for daemon in slurmd slurmctld; do
        if [ -s "/run/$daemon.pid" ] && kill "$(cat "/run/$daemon.pid")" 2>/dev/null; then
            while [ -e "/run/$daemon.pid" ] && kill -0 "$(cat "/run/$daemon.pid" 2>/dev/null)" 2>/dev/null; do sleep 0.2; done
        fi
    done
}

if [ "${1:-start}" = stop ]; then
    stop
    exit
fi

if ! command -v slurmctld >/dev/null || ! command -v munged >/dev/null; then
    apt-get update -q
    DEBIAN_FRONTEND=noninteractive apt-get install -q -y slurm-wlm munge
fi

host=$(hostname -s)
grep -qw "$host" /etc/hosts || echo "127.0.1.1 $host" >>/etc/hosts
megabytes=$(awk '/^MemTotal:/ { print int($2 / 1024 * 0.9) }' /proc/meminfo)

stop
mkdir -p /etc/slurm /var/spool/qinit/slurmctld /var/spool/qinit/slurmd /run/munge
# KillWait is what a job has to save after SIGTERM; linuxproc tracks processes without control groups, as in containers
cat >/etc/slurm/slurm.conf <<CONF
ClusterName=qinit
SlurmctldHost=$host
SlurmUser=root
AuthType=auth/munge
StateSaveLocation=/var/spool/qinit/slurmctld
SlurmdSpoolDir=/var/spool/qinit/slurmd
SlurmctldPidFile=/run/slurmctld.pid
SlurmdPidFile=/run/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
DefMemPerCPU=$((megabytes / ($(nproc) * 2)))
KillWait=30
ReturnToService=2
MpiDefault=none
NodeName=$host CPUs=$(nproc) RealMemory=$megabytes State=UNKNOWN
PartitionName=all Nodes=$host Default=YES MaxTime=INFINITE State=UP
CONF

if ! munge -n 2>/dev/null | unmunge >/dev/null 2>&1; then
    chown munge: /run/munge
    runuser -u munge -- munged
fi
slurmctld
slurmd
for _ in $(seq 60); do
    if sinfo --noheader --format=%T 2>/dev/null | grep -q -E 'idle|mixed|allocated'; then
        exec sinfo
    fi
    sleep 0.5
done
echo "one_node.sh: the node is not ready after 30 s; see: sinfo, and slurmctld and slurmd with -D -v" >&2
exit 1
