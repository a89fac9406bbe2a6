#!/bin/sh
# The main job at the paper's size: `sh tests/demo.sh FOLDER`, or `make demo`. Doing it again completes what is missing.
set -eu
mkdir -p "$1"
cd "$1"
export QINIT_STORE=store

echo "Learning 100 source tasks with Q-learning, 100,000 episodes each" >&2
fit=$(qinit train-sources gridworld --variance 7 | qinit fit -)
echo "Learning 200 target tasks with each method" >&2
for method in zero maxqinit logqinit-median; do
    qinit transfer "$method" "$fit"
done >runs
qinit compare - <runs
qinit plot curves - -o curves.png <runs >/dev/null
echo "Learning curves: $1/curves.png" >&2
