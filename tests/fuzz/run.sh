#!/usr/bin/env bash
# Fuzzes every target, one after another, and prints a table: tests/fuzz/run.sh [SECONDS_A_TARGET [TARGET ...]]
# Exit 1 if there are findings. SECONDS_A_TARGET is processor time (600 unless told).
#
# Needs clang and the preset "fuzz" built (tests/README.md). What it works with is under build/fuzz/corpus/: inputs
# that reach new code, by target, which the next run begins with; findings/<target>/ has what went wrong. Each
# finding is mended, and its input put into tests/fuzz/corpus/<target>/, where the ordinary tests replay it.
set -euo pipefail

seconds=${1:-600}
shift || true
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
build=$root/build/fuzz
work=${CURVISPLAT_FUZZ_WORK:-$build/corpus}

if [[ $# -gt 0 ]]; then
  targets=("$@")
else
  targets=()
  for folder in "$root"/tests/fuzz/corpus/*/; do targets+=("$(basename "$folder")"); done
fi

# Files that targets read go through memory.
scratch=$(mktemp -d -p "$([[ -d /dev/shm ]] && echo /dev/shm || echo "${TMPDIR:-/tmp}")" curvisplat_fuzz.XXXXXX)
trap 'kill $(jobs -p) 2>/dev/null || true; rm -rf "$scratch"' EXIT
export TMPDIR=$scratch
# Signals and sizes are the sanitizer's, also in the processes that targets start (libfuzzer_entry.cpp).
signals=handle_segv=2:handle_abort=2:handle_sigbus=2:handle_sigfpe=2:handle_sigill=2
export ASAN_OPTIONS=allocator_may_return_null=0:max_allocation_size_mb=512:detect_leaks=1:$signals:${ASAN_OPTIONS:-}
export LSAN_OPTIONS=print_suppressions=0:${LSAN_OPTIONS:-}

# Ends process $1 in order once it has used $2 seconds of processor time, with the processes that it has waited for: by the clock, a
# run is cut short by whoever else has the machine, and by a pause.
end_after() {
  local ticks stat
  ticks=$(getconf CLK_TCK)
  while stat=$(cat "/proc/$1/stat" 2>/dev/null); do
    if awk -v ticks="$ticks" -v all="$2" '{ exit !($14 + $15 + $16 + $17 >= all * ticks) }' <<<"$stat"; then
      kill -USR1 "$1"
      return
    fi
    sleep 2
  done
}

findings=0
row='%-18s %12s %9s %9s %8s %8s\n'
printf "$row" target executions cpu_s exec/s edges findings
for target in "${targets[@]}"; do
  program=$build/tests/fuzz/fuzz_$target
  mkdir -p "$work/$target" "$work/findings/$target"
  seeds=("$root/tests/fuzz/corpus/$target")
  if [[ $target == vtk_* ]]; then seeds+=("$root/tests/data/vtk"); fi
  log=$work/$target.log
  : >"$log"
  executions=0 cpu=0 edges=0
  # libcgns loses memory with each damaged file: a new process now and then.
  rounds=()
  [[ $target != cgns_adf ]] || rounds=(-runs=10000)
  TIMEFORMAT='%U %S'
  while awk -v used="$cpu" -v all="$seconds" 'BEGIN { exit !(used + 1 < all) }'; do
    left=$(awk -v used="$cpu" -v all="$seconds" 'BEGIN { printf "%d", all - used }')
    status=0
    {
      time {
        "$program" "$work/$target" "${seeds[@]}" "${rounds[@]}" -rss_limit_mb=2048 -timeout=300 -max_len=65536 -print_final_stats=1 \
          -report_slow_units=60 -artifact_prefix="$work/findings/$target/" >>"$log" 2>&1 &
        fuzzer=$!
        end_after "$fuzzer" "$left" &
        wait "$fuzzer" || status=$?
      }
    } 2>"$scratch/times"
    # libFuzzer times inputs by the clock: after a pause, or beside other work, it reports some that are not slow.
    for slow in "$work/findings/$target"/{slow-unit,timeout}-*; do
      if [[ -f $slow ]] && (ulimit -t 60 && "$program" "$slow" >>"$log" 2>&1); then
        rm "$slow"
        [[ $slow != */timeout-* ]] || status=0
      fi
    done
    cpu=$(awk -v used="$cpu" 'NF == 2 { used += $1 + $2 } END { print used }' "$scratch/times")
    executions=$(awk '/stat::number_of_executed_units/ { sum += $2 } END { print sum + 0 }' "$log")
    edges=$(awk '{ for (n = 1; n < NF; ++n) if ($n == "cov:" && $(n + 1) > most) most = $(n + 1) } END { print most + 0 }' "$log")
    [[ $status -eq 0 ]] || break
  done
  found=$(find "$work/findings/$target" -type f | wc -l)
  findings=$((findings + found))
  printf "$row" "$target" "$executions" "$(printf '%.0f' "$cpu")" \
    "$(awk -v n="$executions" -v s="$cpu" 'BEGIN { printf "%d", (s > 0 ? n / s : 0) }')" "$edges" "$found"
done
[[ $findings -eq 0 ]]
