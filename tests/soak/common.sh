# What the long runs share; sourced, with the script's own arguments: [--short | --full] [PROGRAM [FOLDER [...]]]
# In short, unless CURVISPLAT_WHOLE is set, as tools/test.sh --whole does.
# Sets form (full or short), program, folder (empty, removed in the end), here, rest (further arguments), failed.
form=short
[[ ! -v CURVISPLAT_WHOLE ]] || form=full
case ${1:-} in --short | --full) form=${1#--} && shift ;; esac
program=$(realpath "${1:-build/release/tools/curvisplat}")
folder=$(mktemp -d "$(realpath "${2:-${TMPDIR:-/tmp}}")/soak.XXXXXX")
rest=("${@:3}")
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
finish() {
  for pid in $(jobs -pr); do kill "$pid" 2> /dev/null || true; done
  rm -rf "$folder"
}
trap finish EXIT
trap 'exit 1' INT TERM
export XDG_CONFIG_HOME=$folder/config

failed=0
fail() {
  echo "FAILED: $*"
  failed=1
}
quietly() { "$@" > "$folder/log" 2>&1 || { cat "$folder/log"; exit 1; }; }

# made NAME SIZE SCALAR...: the cache NAME.splats; in full form one that does not compress, as large as its grid.
made() {
  local name=$folder/$1 scalars=()
  quietly "$program" generate half-annulus --size "$2" -o "$name"
  if [ $form = full ]; then
    "$here/roughen.py" "$name.xyz" 12 14
    "$here/roughen.py" "$name.fun" 16 22
  fi
  shift 2
  for scalar in "$@"; do scalars+=(--scalar "$scalar"); done
  quietly "$program" convert "$name.xyz" "$name.fun" -o "$name.splats" "${scalars[@]}" --byte-order little \
    --records none --precision single --blocks single
  rm "$name.xyz" "$name.fun" "$name.nam"
}

# watch PID FILE SECONDS [PICTURE]: a line every so often, as long as it lives: seconds, KiB in memory, open files, threads.
# From when PICTURE is there on: a program that begins opens files and starts threads.
watch() {
  local pid=$1 begin
  begin=$(date +%s.%N)
  while [ -n "${4:-}" ] && [ ! -e "${4:-}" ] && kill -0 "$pid" 2> /dev/null; do sleep 0.01; done
  while kill -0 "$pid" 2> /dev/null; do
    local memory threads files
    memory=$(awk '/^VmRSS/ { print $2 }' "/proc/$pid/status" 2> /dev/null) || break
    threads=$(awk '/^Threads/ { print $2 }' "/proc/$pid/status" 2> /dev/null) || break
    files=$(find "/proc/$pid/fd" -mindepth 1 2> /dev/null | wc -l) || break
    [ -z "$memory" ] || echo "$(date +%s.%N) $begin $memory $files $threads" >> "$2"
    sleep "$3"
  done
}

# judge FILE SLACK: a table of it; its last quarter may have no more than its second. Pictures and files come and go, so their
# medians count, and 4 % and SLACK MiB of memory and 3 files are let pass.
judge() {
  awk -v slack="$2" -v form=$form '
    { t[NR] = $1 - $2; memory[NR] = $3 / 1024; files[NR] = $4; threads[NR] = $5 }
    function most(values, from, to,   n, m) { m = 0; for (n = from; n <= to; ++n) if (values[n] > m) m = values[n]; return m }
    function median(values, from, to,   n, m, count, sorted) {
      for (n = from; n <= to; ++n) {
        for (m = count++; m > 0 && sorted[m - 1] > values[n]; --m) sorted[m] = sorted[m - 1]
        sorted[m] = values[n]
      }
      return sorted[int(count / 2)]
    }
    END {
      rows = NR < 12 ? NR : 12
      print "      seconds   memory [MiB]   open files   threads"
      for (row = 0; row < rows; ++row) {
        n = rows == 1 ? 1 : 1 + int(row * (NR - 1) / (rows - 1))
        printf "%13.1f %14.1f %12d %9d\n", t[n], memory[n], files[n], threads[n]
      }
      if (NR < 8) { print "over too soon for a judgement of memory, files and threads"; exit form == "full" }
      half = int(NR / 2); quarter = int(NR / 4); last = NR - quarter
      before = median(memory, quarter, half); after = median(memory, last, NR)
      printf "memory: median %.1f MiB in the second quarter, %.1f in the last; most %.1f\n", before, after, most(memory, 1, NR)
      bad = 0
      if (after > 1.04 * before + slack) { print "FAILED: memory grows"; bad = 1 }
      if (median(files, last, NR - 1) > median(files, quarter, half) + 3) { print "FAILED: open files grow"; bad = 1 }
      # One thread may come and go; the few samples of a short run need not have seen it.
      if (most(threads, last, NR) > most(threads, quarter, half) + (form == "short")) { print "FAILED: threads grow"; bad = 1 }
      exit bad
    }' "$1" || failed=1
}
