#!/usr/bin/env bash
# The figures of results/classical.md: classical planners on the original courses, by the protocols of the published figures.
#
#   results/classical.sh COLLECTION [OUTPUT] [PART...]
#
# COLLECTION: the original courses, as `./slalom courses import` wrote them (docs/courses.md).
# OUTPUT: directory of the results [runs/classical]. A result that is there already is not driven again.
# PART: static-test (the paper's table II), dwa-runs, challenge, dynamic, real-world [all].
set -euo pipefail
root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)
collection=${1:?usage: classical.sh COLLECTION [OUTPUT] [PART...]}
output=${2:-runs/classical}
parts=("${@:3}")
((${#parts[@]})) || parts=(static-test dwa-runs challenge dynamic real-world)
mkdir -p "$output"

# drive PART NAME AGENT COURSES OPTION...
drive() {
  local directory=$output/$1/$2 agent=$3 courses=$4 begin=$SECONDS
  shift 4
  [[ -f $directory/evaluation.json ]] && return
  "$root/slalom" evaluate --agent "$agent" --courses "$courses" --collection "$collection" --output "$directory" "$@"
  echo "$agent on $courses: $((SECONDS - begin)) s on $(nproc) cores" | tee "$directory/time.txt"
}

for part in "${parts[@]}"; do
  case $part in
    static-test)
      for agent in dwa teb eband mppi; do drive "$part" "$agent" "$agent" static-test; done ;;
    dwa-runs) drive "$part" dwa dwa static --protocol dwa-runs --episodes 2 ;;
    challenge) drive "$part" dwa dwa static-challenge --protocol barn-challenge ;;
    dynamic)
      for agent in dwa mppi; do
        for courses in dynamic-box-test dynamic-wall-test; do drive "$part" "$agent-$courses" "$agent" "$courses" --episodes 1; done
      done ;;
    real-world)
      for agent in dwa mppi; do
        for course in 1 2 3; do
          drive "$part" "$agent-$course" "$agent" "real-world-$course" --profile "$root/configs/real-robot.toml" --episodes 3
        done
      done ;;
    *) echo "no part '$part'; there are: static-test dwa-runs challenge dynamic real-world" >&2; exit 2 ;;
  esac
  "$root/slalom" report "$output/$part"/*/ --output "$output/$part"
done
