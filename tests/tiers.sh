# The tiers of `./slalom test`, read by the wrapper: what each part builds and runs, and the summary at the end.
# docs/testing.md says what a tier is for and how long each part takes.

build_packages=(libgtest-dev libgmock-dev clang-format chromium ffmpeg xz-utils python3 libode-dev libmujoco-dev)
all_packages=(libbenchmark-dev clang libclang-rt-dev clang-tidy g++-aarch64-linux-gnu qemu-user prometheus docker.io docker-compose mmdebstrap slurmctld slurmd slurm-client munge)
ros_packages=(iproute2 rosout python3-roslaunch python3-rospy python3-rosmaster python3-sensor-msgs python3-nav-msgs python3-geometry-msgs python3-std-msgs python3-diagnostic-msgs python3-rosgraph-msgs python3-tf2-msgs python3-rosbag)

test_help() {
  cat <<'HELP'
./slalom test [--all | --soak] [--part PART]... [--within MINUTES] [--label LABEL] [--record FILE] [CTEST ARGUMENT...]

Builds and tests Slalom, and ends with one line per part. Without options: what every change must pass, in 15 minutes on two cores.

  --all          what continuous integration runs, in 35 to 80 minutes: adds sanitizers, clang-tidy, live fuzzing, all drills,
                 containers, and the first command on a bare root
  --soak         hours, before a release: the long drills, a hundred random faults, packages and image for Debian 13, long fuzzing
  --part PART    only this part; may be given more than once
  --within MINUTES  leaves out each part that would not end in this time, as fast as the parts before it were, and names it
  --label LABEL  only tests with this label (their folder, or slow, drill, deploy), in part release; other arguments go to ctest, for
                 example -R NAME
  --record FILE  writes the summary as a Markdown table, too

Parts:
  format    clang-format changes nothing                                                                      in every tier
  release   all tests, optimised; with --all under clocks of a machine that has just started, and the benchmarks build  in every tier
  deploy    containers, Slurm, Prometheus and bare roots, with the program of part release                            --all
  drills    processes that are killed, cut off, starved and attacked, with the program of part release                --all
  dev       an unoptimised simulator drives the same episodes, bit for bit                                           --all
  asan      the tests of the folders without LibTorch under AddressSanitizer and UndefinedBehaviorSanitizer         --all
  tsan      those of them with threads under ThreadSanitizer                                                        --all
  tidy      clang-tidy with clang's thread-safety analysis                                                          --all
  arm64     what drives by a policy, compiled for 64-bit ARM, and its tests under an emulator                       --all
  python    the Python package: its tests with Debian's Python and, in a virtual environment, with Gymnasium and ONNX Runtime --all
  ros       drives through topics of ROS 1, and of ROS 2 in a virtual environment, by the nodes of ros/slalom_ros      --all
  fuzz      every reader of what a peer or a file holds, fed by libFuzzer: 10 s of new inputs each                  --all
  soak      drills at full length, wheels, packages and image compiled for Debian 13, a minute for each fuzzer        --soak
HELP
}

clocks=()  # A command that runs the tests under other clocks, see young_clocks.

# run_ctest PRESET ARGUMENT...: the tests whose programs are built. Those of GoogleTest are left out where they are not built; a part
# that builds none of another kind leaves that kind out by its label.
run_ctest() {
  local preset=$1 status=0
  shift
  "${clocks[@]}" ctest --test-dir "$root/build/$preset" --output-on-failure -j "$jobs" --no-tests=error -E '_NOT_BUILT$' "$@" |
    tee -a "$root/build/$preset.ctest.log" || status=$?
  cat "$root/build/$preset/Testing/Temporary/LastTest.log" >>"$root/build/$preset.ctest-details.log" || true
  return "$status"
}

# young_clocks: sets `clocks` to a command that runs another under clocks of a machine that was started 30 seconds ago. Returns 1 if the
# kernel refuses that. Code that takes the steady clock's beginning for "long ago" is wrong on such a machine only.
young_clocks() {
  local up offset
  read -r up _ </proc/uptime
  offset=$((30 - ${up%.*}))
  clocks=(unshare --time --monotonic "$offset" --boottime "$offset")
  [[ $("${clocks[@]}" cut -d . -f 1 /proc/uptime 2>/dev/null) == 3? ]] || { clocks=(); return 1; }
}

# ctest_result PRESET: "123 passed, 0 failed, 1 skipped", out of what ctest wrote.
ctest_result() {
  awk '
    / tests failed out of / { failed += $(NF - 5); total += $NF }
    /\*\*\*Skipped/ { ++skipped }
    END { if (total) printf "%d passed, %d failed%s", total - failed - skipped, failed, skipped ? ", " skipped " skipped" : "" }
  ' "$root/build/$1.ctest.log" 2>/dev/null || true
}

# skipped_tests PRESET: "NAME: REASON" for each test that ctest says was skipped.
skipped_tests() {
  local log=$root/build/$1.ctest.log details=$root/build/$1.ctest-details.log
  [[ -f $log ]] || return 0
  sed -n 's/^ *[0-9]*\/[0-9]* *Test *#[0-9]*: \(.*[^ .]\) \.*\*\*\*Skipped.*/\1/p' "$log" | sort | while IFS= read -r name; do
    awk -v name="$name" '
      /^[0-9]+\/[0-9]+ (Test|Testing): / { here = substr($0, index($0, ": ") + 2) == name }
      here && /: Skipped$/ { getline; print name ": " $0; found = 1; exit }
      here && /^SKIPPED: / { print name ": " substr($0, 10); found = 1; exit }
      END { if (!found) print name ": no reason given" }' "$details" 2>/dev/null
  done
}

# failed_tests PRESET: "NAME" for each test that failed, and under it the last lines that it wrote.
failed_tests() {
  local log=$root/build/$1.ctest.log details=$root/build/$1.ctest-details.log
  [[ -f $log ]] || return 0
  awk '/^The following tests FAILED:/ { listed = 1; next } /^[^\t ]/ { listed = 0 } listed && NF' "$log" |
    sed -n 's/^[[:space:]]*[0-9]* - \(.*[^ ]\) ([^()]*).*/\1/p' | sort -u | while IFS= read -r name; do
    echo "$name"
    awk -v name="$name" '
      /^[0-9]+\/[0-9]+ (Test|Testing): / { here = substr($0, index($0, ": ") + 2) == name; next }
      here && /^Test time = / { exit }
      /^\[[-= ]|^Running main|^Note: Google Test|^<end of output>/ { next }
      here && NF { lines[count++] = "    " $0 }
      END { for (i = count > 12 ? count - 12 : 0; i < count; ++i) print lines[i] }' "$details" 2>/dev/null
  done
}

part_format() {
  local listed file files=()
  mapfile -t listed < <(cd "$root" && git ls-files --cached --others --exclude-standard '*.h' '*.cc' '*.inc')
  # A file that was deleted is still listed. Without any file clang-format would wait for its input.
  for file in "${listed[@]}"; do [[ ! -f $root/$file ]] || files+=("$file"); done
  ((${#files[@]} > 0)) || fail "git lists no sources in $root, expected a clone"
  (cd "$root" && wc -l -- "${files[@]}") | awk '$1 > 600 && $2 != "total" { print "warning: " $2 " has " $1 " lines; is it one idea?" }'
  (cd "$root" && clang-format --dry-run -Werror "${files[@]}")
}
part_release() {
  if [[ $tier == quick ]]; then
    configure release SLALOM_TESTS=ON SLALOM_BENCHMARKS=OFF
  else
    configure release SLALOM_TESTS=ON SLALOM_BENCHMARKS=ON
  fi
  build_targets release all
  if (($# > 0)); then
    run_ctest release "$@"
  elif [[ $tier == quick ]]; then
    run_ctest release -LE 'long'
  else
    young_clocks || true
    run_ctest release -LE 'drill|deploy'
  fi
}
# test_label LABEL: the tests of the release build that have the label.
test_label() {
  configure release SLALOM_TESTS=ON
  build_targets release all
  run_ctest release -L "$1"
}
part_deploy() { test_label deploy; }
part_drills() { test_label drill; }
part_dev() {
  configure dev
  build_targets dev environments_test
  run_ctest dev -L sim -LE engines
}
part_asan() {
  configure asan
  build_targets asan all
  run_ctest asan -LE 'deploy|golden'  # Minutes under sanitizers; the planners' other tests run the same code.
}
part_tsan() {
  configure tsan
  build_targets tsan base_test environments_test robot_test engine_body_test no_physics_test actor_test actor_service_test eval_test transport_test replay_service_test
  run_ctest tsan -LE 'deploy|fuzz'
}
part_arm64() {
  configure arm64
  build_targets arm64 all
  run_ctest arm64
}
part_tidy() {
  configure tidy
  build_targets tidy slalom_onnx_wire slalom_proto_wire slalom_run_wire slalom_version
  # What the preset compiles: the sources of a library some at a time, so that their headers are parsed once.
  (cd "$root" && sed -n 's/^  "file": "\(.*\)",\?$/\1/p' build/tidy/compile_commands.json |
    grep -vE '/generated/|slalom_proto_wire|_headers\.cc|small_gemm_avx' | tr '\n' '\0' |
    xargs -0 -n 1 -P "$jobs" clang-tidy --quiet --warnings-as-errors='*' -p build/tidy 2> >(grep -v ' warnings generated' >&2))
}

# with_python COMMAND...: with the Python package's build, and the environment of its tests. The policy is any that this program has
# trained.
with_python() {
  local runs=$root/build/python/trained
  local policy=$runs/tiny/policy.safetensors
  build_program
  VIRTUAL_ENV='' build_python
  if [[ ! $policy -nt $program ]]; then
    rm -rf "$runs"
    "$program" train "$root/configs/quickstart.toml" --deterministic --no-evaluation --output "$runs" --name tiny \
      --set run.max_seconds=0 --set run.max_steps=100000
  fi
  SLALOM_POLICY=$policy SLALOM_PROGRAM=$program "$@"
}
part_python() { with_python run_ctest python -LE ros; }
part_ros() { with_python run_ctest python -L ros; }
soak_python() {
  PYTHONPATH=$root/build/python/python with_python bash "$root/tests/app/python/soak.sh" "$root/build/python/soak"
}

# fuzz NAME: what it finds stays in build/fuzz/found/NAME, and what crashes it in build/fuzz/NAME-crash-*.
fuzz() {
  local root=$1 seconds=$2 name=$3
  local new=$root/build/fuzz/found/$name log=$root/build/fuzz/$name.log
  mkdir -p "$new"
  if "$root/build/asan/fuzzers/${name}_fuzz" -max_total_time="$seconds" -timeout=20 -rss_limit_mb=1024 \
    -artifact_prefix="$root/build/fuzz/$name-" "$new" "$root/tests/fuzz/corpus/$name" >"$log" 2>&1; then
    echo "$name: $(grep -a '^Done' "$log")"
  else
    tail -n 40 "$log"
    echo "$name: FAILED; the whole log is in $log"
    return 1
  fi
}
fuzz_all() {
  configure asan
  build_targets asan slalom_fuzzers
  export -f fuzz
  find "$root/tests/fuzz/corpus" -mindepth 1 -maxdepth 1 -printf '%f\0' |
    xargs -0 -P "$jobs" -I NAME bash -c 'fuzz "$1" "$2" NAME' - "$root" "$1"
}
part_fuzz() { fuzz_all 10; }

# Drills at the lengths of docs/reliability.md; the Python package as a wheel and with MuJoCo; packages and image compiled from source on
# Debian 13, against its LibTorch 2.x.
part_soak() {
  local drill failed=0
  configure release SLALOM_TESTS=ON
  build_targets release all
  for drill in "kill 30" "stop 5" "restart 10" "hostile 30" "network 10" "disk" "shards 20" "oom" "crowd 64 30" "backup 5" "random 100" "soak 900"; do
    say "soak: $drill"
    # shellcheck disable=SC2086 # The arguments of a drill are words.
    set -- $drill
    python3 "$root/tests/drills/$1_drill.py" "$program" "${@:2}" || { say "drill $drill FAILED"; failed=1; }
  done
  say "soak: python"
  soak_python || failed=1
  say "soak: packages for Debian 13"
  python3 "$root/tests/deploy/packages_test.py" trixie || failed=1
  SLALOM_IMAGE_FROM=source run_ctest release -R '(cluster|stack)_in_containers' || failed=1
  fuzz_all 60 || failed=1
  return "$failed"
}

# What each part takes from a clean clone on a slow machine with two cores [s].
declare -A usual_seconds=([format]=10 [release]=1200 [asan]=800 [fuzz]=80 [tsan]=240 [tidy]=500 [python]=240 [ros]=240 [dev]=100 [deploy]=1350 [drills]=850 [arm64]=180)

# ends_within MINUTES PART ELAPSED USUAL: whether a part would end in time, if it is as much slower or faster than usual as what
# took ELAPSED seconds here and takes USUAL usually. 0 minutes: always.
ends_within() {
  (($1 == 0 || $4 == 0 || SECONDS + ${usual_seconds[$2]-0} * $3 / $4 <= 60 * $1))
}

# write_record FILE LINE...: the summary as a table.
write_record() {
  local file=$1
  shift
  {
    echo "# How long the tests take"
    echo
    echo "Made by \`./slalom test${tier_option:+ $tier_option} --record\` on $(nproc) cores" \
      "($(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1)), commit" \
      "$(git -C "$root" rev-parse --short HEAD 2>/dev/null || echo unknown), $(((SECONDS + 30) / 60)) minutes in all."
    echo
    echo "| part | result | minutes | tests |"
    echo "|---|---|---|---|"
    printf '%s\n' "$@" | awk '{ printf "| %s | %s | %.1f |", $2, $1, $3 / 60; for (i = 5; i <= NF; ++i) printf " %s", $i; print " |" }'
  } >"$file"
}

# Each part in a shell of its own, so that one which fails does not keep the others from running.
run_tests() {
  local parts=(format release deploy drills dev arm64 asan tsan tidy python ros fuzz soak) chosen=() ctest_arguments=() record="" within=0
  tier=quick tier_option=""
  while (($# > 0)); do
    case $1 in
      -h | --help) test_help; return 0 ;;
      --all) tier=all tier_option=--all ;;
      --soak) tier=soak tier_option=--soak ;;
      --part)
        [[ " ${parts[*]} " == *" ${2-} "* ]] || fail "--part ${2-}: expected one of ${parts[*]}"
        chosen+=("$2"); shift ;;
      --label) ctest_arguments+=(-L "${2?--label needs a label}"); shift ;;
      --record) record=${2?--record needs a file}; shift ;;
      --within)
        [[ ${2-} =~ ^[1-9][0-9]*$ ]] || fail "--within ${2-}: expected a number of minutes"
        within=$2; shift ;;
      --*) fail "unknown option $1; ./slalom test --help lists them" ;;
      *)
        [[ " ${parts[*]} " != *" $1 "* ]] || fail "$1 is a part: --part $1"
        ctest_arguments+=("$1") ;;
    esac
    shift
  done
  if ((${#chosen[@]} == 0)); then
    if ((${#ctest_arguments[@]} > 0)); then
      chosen=(release)
    elif [[ $tier == quick ]]; then
      chosen=(format release)
    elif [[ $tier == all ]]; then
      chosen=(format release asan fuzz tsan tidy python ros dev deploy drills arm64)  # With --within the last ones are left out first.
    else
      chosen=(soak)
    fi
  fi
  ((${#ctest_arguments[@]} == 0)) || [[ " ${chosen[*]} " == *" release "* ]] ||
    fail "${ctest_arguments[*]}: only part release takes arguments for ctest"
  local packages=("${run_packages[@]}" "${build_packages[@]}")
  [[ "$tier ${chosen[*]}" =~ ^quick\ (format|release|\ )*$ ]] || packages+=("${all_packages[@]}")
  [[ " ${chosen[*]} " != *" ros "* ]] || packages+=("${ros_packages[@]}")
  install_packages "${packages[@]}"
  check_blas

  local part preset summary=() failures=() skipped=() left_out=() failed=0 start status
  local begin=$SECONDS usual=0
  for part in "${chosen[@]}"; do
    if ! ends_within "$within" "$part" $((SECONDS - begin)) "$usual"; then
      say "test: $part is left out: it would not end within $within minutes"
      left_out+=("$part")
      continue
    fi
    say "test: $part, after $(((SECONDS + 30) / 60)) minutes"
    usual=$((usual + ${usual_seconds[$part]-0}))
    # The tests of these are those of another part's build.
    preset=$part
    [[ $part != @(soak|deploy|drills) ]] || preset=release
    [[ $part != ros ]] || preset=python
    rm -f "$root/build/$preset.ctest.log" "$root/build/$preset.ctest-details.log"
    start=$SECONDS
    status=0
    local arguments=()
    [[ $part != release ]] || arguments=("${ctest_arguments[@]}")
    set +e
    (set -e; "part_$part" "${arguments[@]}")
    status=$?
    set -e
    if ((status == 0)); then
      summary+=("$(printf 'passed  %-8s %5d s  %s' "$part" $((SECONDS - start)) "$(ctest_result "$preset")")")
    else
      ((failed += 1))
      summary+=("$(printf 'FAILED  %-8s %5d s  %s' "$part" $((SECONDS - start)) "$(ctest_result "$preset")")")
    fi
    local line
    while IFS= read -r line; do failures+=("$part: $line"); done < <(failed_tests "$preset")
    while IFS= read -r line; do skipped+=("$part: $line"); done < <(skipped_tests "$preset")
  done
  echo
  if ((${#skipped[@]} > 0)); then
    echo "${#skipped[@]} tests were skipped:"
    printf '  %s\n' "${skipped[@]}"
    # Where everything is installed only the machine's own properties may keep a test from running.
    if [[ ${CI-} == true ]]; then
      local unexpected
      unexpected=$(printf '%s\n' "${skipped[@]}" | grep -vE -f <(grep -v '^#' "$root/tests/may_skip.txt") || true)
      if [[ -n $unexpected ]]; then
        printf 'FAILED: these must not be skipped here (tests/may_skip.txt lists those that may):\n%s\n' "$unexpected"
        ((failed += 1))
      fi
    fi
    echo
  fi
  if ((${#failures[@]} > 0)); then
    echo "These tests failed, with the last lines that each wrote:"
    printf '  %s\n' "${failures[@]}"
    echo
  fi
  if ((${#left_out[@]} > 0)); then
    printf '%d parts were left out, as they would not have ended within %d minutes: %s\n\n' "${#left_out[@]}" "$within" "${left_out[*]}"
  fi
  if [[ $tier == all && " ${chosen[*]} " == *" release "* ]] && ! young_clocks; then
    printf 'release ran under the clocks of this machine: its kernel or user cannot start processes under younger ones.\n\n'
  fi
  printf '%s\n' "${summary[@]}"
  [[ -z $record ]] || write_record "$record" "${summary[@]}"
  echo "slalom test: ${#summary[@]} parts, $failed failed, in $SECONDS s"
  ((failed == 0))
}
