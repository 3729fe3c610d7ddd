#!/usr/bin/env bash
# The figures of results/static.md: trains every seed of every setting and scores it, about 3.5 minutes each.
#
#   results/static-figures.sh COLLECTION [OUTPUT] [SEEDS] [SETTINGS]
#
# COLLECTION: the original courses, as `./slalom courses import DIR --output COLLECTION` wrote them.
# OUTPUT: directory of the runs [runs/static-figures]. SEEDS: [1 2 3]. SETTINGS:
# [static-train-250 static-train-50 lifelike]. A run that is there already is not repeated.
set -euo pipefail
root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)
collection=$(readlink -f -- "${1:?usage: static-figures.sh COLLECTION [OUTPUT] [SEEDS] [SETTINGS]}")
output=${2:-runs/static-figures}
seeds=${3:-1 2 3}
settings=${4:-static-train-250 static-train-50 lifelike}
slalom=$root/slalom
times='run.snapshot_seconds=[3,4,5,6,7,8,10,12,15,20,30,45,60,90,120]'

# json_number FILE KEY: a number of an evaluation's JSON object.
json_number() { sed -n "s/^ *\"$2\": *\([-0-9.e]*\),\{0,1\}$/\1/p" "$1" | head -n 1; }
# time_to CURVE RATE: training seconds of the first snapshot at or above a success rate.
time_to() { awk -F, -v rate="$2" 'NR > 1 && $4 >= rate { print $1; found = 1; exit } END { if (!found) print "-" }' "$1"; }

echo "| setting | seed | to 65 % [s] | to 95 % [s] | static-test | collision | timeout | traversal [s] | 300 fresh courses | steps |"
echo "|---|---|---|---|---|---|---|---|---|---|"
for setting in $settings; do
  for seed in $seeds; do
    name=$setting-seed$seed
    run=$output/$name
    config=$root/configs/fast.toml train=$setting
    if [[ $setting == lifelike ]]; then config=$root/configs/lifelike.toml train=static-train-250; fi
    if [[ ! -f $run/fresh.json ]]; then
      "$slalom" train "$config" --name "$name" --seed "$seed" --output "$output" --set "courses.train=$train" \
        --set "courses.collection=$collection" --set "$times" >"$output.$name.log" 2>&1
      rm -rf "$run/checkpoints"
      "$slalom" evaluate --policy "$run/policy.safetensors" --courses generated:2026:300 --json >"$run/fresh.json" 2>/dev/null
    fi
    percent() { awk -v x="$(json_number "$1" "$2")" 'BEGIN { printf "%.1f %%", 100 * x }'; }
    echo "| $setting | $seed | $(time_to "$run/curve.csv" 0.65) | $(time_to "$run/curve.csv" 0.95)" \
      "| $(percent "$run/evaluation.json" success_rate) | $(percent "$run/evaluation.json" collision_rate)" \
      "| $(percent "$run/evaluation.json" timeout_rate) | $(json_number "$run/evaluation.json" traversal_time_s)" \
      "| $(percent "$run/fresh.json" success_rate) | $(tail -n 1 "$run/curve.csv" | cut -d, -f2) |"
  done
done
