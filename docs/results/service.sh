#!/usr/bin/env bash
# service.sh OUTPUT: what the distributed service costs beside `slalom train`: time to 90 % on static-test by both, same preset and seed.
#
# Policies are kept at the same training times and scored afterwards; training time counts from the start of the process that learns.
set -euo pipefail

root=$(cd -- "$(dirname -- "$(readlink -f -- "${BASH_SOURCE[0]}")")/../.." && pwd)
output=${1?usage: service.sh OUTPUT [SEED...]}
shift
seeds=("${@:-1}")
program=$root/build/release/cli/slalom
times='[4, 6, 8, 10, 12, 14, 16, 18, 20, 24, 28, 32, 36, 40, 50, 60]'
mkdir -p "$output"

# score NAME DIRECTORY: lines "seconds success" of the policies in DIRECTORY/snapshots.
score() {
  local policy result
  for policy in "$2"/snapshots/*.safetensors; do
    result=$output/$1/$(basename "$policy" .safetensors)
    "$program" evaluate --policy "$policy" --courses static-test --output "$result" >"$result.log" 2>&1 || { cat "$result.log" >&2; exit 1; }
    python3 - "$policy" "$result/evaluation.json" <<'PYTHON'
import json, struct, sys
with open(sys.argv[1], "rb") as file:
    meta = json.loads(file.read(struct.unpack("<Q", file.read(8))[0]))["__metadata__"]
rate = json.load(open(sys.argv[2]))["success_rate"]
print(float(meta["training_s"]), meta["steps"], meta["updates"], rate)
PYTHON
  done | sort -n >"$output/$1.txt"
  awk -v name="$1" '$4 >= 0.9 && !found { found = 1; printf "%s: %.1f %% after %.1f s (%s steps, %s updates)\n", name, 100 * $4, $1, $2, $3 }
    END { if (!found) print name ": 90 % not reached" }' "$output/$1.txt"
}

for seed in "${seeds[@]}"; do
  common=(--set run.max_seconds=60 --set "run.snapshot_seconds=$times" --set run.checkpoint_seconds=0 --set "run.seed=$seed")
  mkdir -p "$output/train-$seed" "$output/service-$seed"
  "$program" train "$root/configs/fast.toml" --no-evaluation --name "train-$seed" --output "$output/runs" "${common[@]}" \
    >"$output/train-$seed.log" 2>&1
  score "train-$seed" "$output/runs/train-$seed"

  state=$output/state-$seed
  rm -rf "$state"
  for role in replay learner actor; do
    more=()
    [[ $role != learner ]] || more=(--set learner_service.exit_when_finished=true)
    "$program" $role --config "$root/configs/fast.toml" --set "service.state=$state" "${common[@]}" "${more[@]}" \
      >"$output/$role-$seed.log" 2>&1 &
    declare "$role=$!"
  done
  # shellcheck disable=SC2154
  wait "$learner"
  # shellcheck disable=SC2154
  kill "$actor" "$replay"
  wait "$actor" "$replay" || true
  score "service-$seed" "$state/learner"
done
