#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds, tests, sanitizes and benchmarks the CUDA backend on a machine with a card; needs no network. Leaves a folder
# with a log a part and summary.md; the exit code is 1 if any part failed.
#
#   scripts/gpu.sh [--bin FOLDER] [--out FOLDER] [--parts LIST] [--limit SECONDS] [--mesh FILE] [--commit TEXT]
#
# --bin     programs that were built elsewhere; without it, build/gpu is configured and built for this machine's card
# --out     the report, default build/gpu-report
# --parts   of: tests memcheck racecheck initcheck synccheck stages tables; separated by commas, default all
# --limit   fails a program that runs longer, default 0: none does
# --mesh    for the paper's tables: default as in bench/paper_tables.py
# --commit  what the programs were built from, if this is no checkout
set -uo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
bin= out=$root/build/gpu-report parts=tests,memcheck,racecheck,initcheck,synccheck,stages,tables mesh= limit=0
commit=$(git -C "$root" describe --always --dirty 2>/dev/null || echo unknown)
while [ $# -gt 0 ]; do
  case "$1" in
    --bin) bin=$(cd "$2" && pwd) || exit 2; shift 2 ;;
    --out) out=$2; shift 2 ;;
    --parts) parts=$2; shift 2 ;;
    --limit) limit=$2; shift 2 ;;
    --mesh) mesh=$2; shift 2 ;;
    --commit) commit=$2; shift 2 ;;
    *) sed -n '3,14s/^# \{0,1\}//p' "$0"; exit 2 ;;
  esac
done
mkdir -p "$out"
out=$(cd "$out" && pwd)
summary=$out/summary.md
failed=0

# record NAME RESULT SECONDS REMARK
record() {
  echo "| $1 | $2 | $3 | $4 |" >>"$summary"
  echo "$1: $2 ($3 s) $4"
  [ "$2" != FAILED ] || failed=1
}

# Runs a command as a part; its output goes to a log of the part's name, the last line of it that matches into the table.
part() {
  local name=$1 pattern=$2 begin=$SECONDS result=passed
  shift 2
  "$@" >"$out/$name.log" 2>&1 || result=FAILED
  record "$name" "$result" $((SECONDS - begin)) "$(grep -aE "$pattern" "$out/$name.log" | tail -n 1 | tr -d '|\r')"
}
wanted() { [[ ",$parts," == *",$1,"* ]]; }

build() {
  local architecture
  architecture=$(nvidia-smi --query-gpu=compute_cap --format=csv,noheader | head -n 1 | tr -d .)
  cmake --preset cuda -S "$root" -B "$root/build/gpu" -DPOINTFAIR_TESTS=ON -DPOINTFAIR_VIEWER=OFF \
    -DPOINTFAIR_CUDA_ARCHITECTURES="$architecture-real" &&
    cmake --build "$root/build/gpu" --target pointfair_cli pointfair_tests cuda_stage_times paper_tables
}

# The tests that use a card, and those of them whose cells are only dense on larger clouds.
card_tests='Cuda*:HostBuffer.*:*every_device*:Cards.of_this_machine*'
dense_tests='Cuda*dense*:Cuda*share_a_cell*'

# sanitize TOOL POINTS PROCESSES [TESTS]: the tests that use a card under a tool of compute-sanitizer, on clouds of at
# most so many points, divided among processes that run at once.
sanitize() {
  local sanitizer=compute-sanitizer n pids=() failures=0
  command -v $sanitizer >/dev/null || sanitizer=/usr/local/cuda/bin/compute-sanitizer
  for ((n = 0; n < $3; n++)); do
    GTEST_TOTAL_SHARDS=$3 GTEST_SHARD_INDEX=$n POINTFAIR_TEST_POINTS=$2 timeout "$limit" "$sanitizer" --tool "$1" \
      --error-exitcode 9 "$bin/pointfair_tests" --gtest_filter="${4:-$card_tests}" >"$out/$1.$n.log" 2>&1 &
    pids+=($!)
  done
  for ((n = 0; n < $3; n++)); do
    wait "${pids[n]}" || failures=$((failures + 1))
    cat "$out/$1.$n.log"
    rm "$out/$1.$n.log"
  done
  echo "tests passed: $(grep -ac '\[       OK' "$out/$1.log"), skipped: $(grep -ac '\[  SKIPPED' "$out/$1.log"), reports:" \
    "$(grep -aoE 'SUMMARY: [0-9]+' "$out/$1.log" | awk '{s += $2} END {print s + 0}'), processes that failed: $failures of $3"
  [ $failures = 0 ] && ! grep -aq SKIPPED "$out/$1.log"
}

# Far slower than the other tools.
check_races() {
  sanitize racecheck 500 12 && sanitize racecheck 6000 3 "$dense_tests"
}

# All unit tests; a backend whose tests were skipped has shown nothing.
tests() {
  timeout "$limit" "$bin/pointfair_tests" || return 1
  ! grep -aq 'SKIPPED.*Cuda' "$out/tests.log"
}

# Resident on the card and from host to host; 100 million points where the card has room for them.
stages() {
  local megabytes size repeat
  megabytes=$(nvidia-smi --query-gpu=memory.total --format=csv,noheader,nounits | head -n 1)
  for size in 1000000 10000000 100000000; do
    if [ $size = 100000000 ] && [ "$megabytes" -lt 30000 ]; then echo "$size points left out: $megabytes MiB"; break; fi
    repeat=$((size == 1000000 ? 15 : size == 10000000 ? 5 : 2))
    timeout "$limit" "$bin/cuda_stage_times" $size $repeat && timeout "$limit" "$bin/cuda_stage_times" $size $repeat host ||
      return 1
  done
}

tables() {
  timeout "$limit" "$root/bench/paper_tables.py" --bin "$bin" --out "$out/paper" ${mesh:+--mesh "$mesh"}
}

{
  echo "| | |"
  echo "|---|---|"
  echo "| card | $(nvidia-smi --query-gpu=name,compute_cap,memory.total,clocks.max.sm --format=csv,noheader | tr '\n' ' ') |"
  echo "| driver | $(nvidia-smi --query-gpu=driver_version --format=csv,noheader | head -n 1) |"
  echo "| compiler | $(nvcc --version 2>/dev/null | grep -o 'release.*' || echo none here) |"
  echo "| processor | $(nproc) x $(grep -m1 'model name' /proc/cpuinfo | cut -d: -f2) |"
  echo "| commit | $commit |"
  echo
  echo "| part | result | seconds | |"
  echo "|---|---|---|---|"
} >"$summary"

if ! nvidia-smi >/dev/null 2>&1; then
  record card FAILED 0 "no NVIDIA driver or card here"
  exit 1
fi
if [ -z "$bin" ]; then
  if ! command -v nvcc >/dev/null; then
    record build FAILED 0 "no nvcc here: build elsewhere and give --bin"
    exit 1
  fi
  part build '^\[' build
  bin=$root/build/gpu/bin
fi

if wanted tests; then part tests '\[  (PASSED|FAILED)' tests; fi
for tool in memcheck initcheck synccheck; do
  if wanted $tool; then part $tool '^tests passed' sanitize $tool 50000 8; fi
done
if wanted racecheck; then part racecheck '^tests passed' check_races; fi
if wanted stages; then part stages '^even +[0-9]+ +8 ' stages; fi
if wanted tables; then part tables 'pointfair CUDA.*[0-9]' tables; fi
cat "$summary"
exit $failed
