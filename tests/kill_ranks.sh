#!/usr/bin/env bash
# Kills one rank of a conversion by three in every pass; has it done by another number of ranks, and compares the result with
# one process's. Prints a table; exit status 1 if a result differs (words in capitals), 77 if there is no mpirun.
#
#   tests/kill_ranks.sh [PROGRAM [SIZE [KILLS [FOLDER]]]]
#
# KILLS are those of each pass, at moments spread over it; without them there is one in every second pass, which
# kill_ranks_that_add.py has the others of. SIZE is the generated grid's (47x40x36, not refined: several bricks), FOLDER
# has room for 250 bytes a node. With CURVISPLAT_WHOLE (tools/test.sh --whole) 20 and 160x120x100: 2 M nodes. dying_ranks lies beside PROGRAM.
set -euo pipefail

program=$(realpath "${1:-build/release/tools/curvisplat}")
dying=$(dirname "$program")/dying_ranks
usual=(47x40x36 1) every=2
[[ ! -v CURVISPLAT_WHOLE ]] || usual=(160x120x100 20)
[[ ! -v CURVISPLAT_WHOLE && $# -lt 3 ]] || every=1
size=${2:-${usual[0]}}
kills=${3:-${usual[1]}}
if ! command -v mpirun > /dev/null || [ ! -e "$(dirname "$program")/curvisplat-mpi.so" ]; then
  echo "skipped: no mpirun (Debian: openmpi-bin), or built without MPI"
  exit 77
fi
folder=$(mktemp -d "${4:-/tmp}/kill_ranks.XXXXXX")
trap 'rm -rf "$folder"' EXIT
trap 'exit 1' INT TERM

cache=$folder/work/a.splats
log=$folder/log
statistics=$folder/stats.json
grid=("$folder/in.xyz" "$folder/in.fun")
convert=(convert "${grid[@]}" -o "$cache" --threads 1 --memory 256M --refine 1)  # cells whole, as dying_ranks has them
mpirun=(mpirun --oversubscribe --allow-run-as-root --bind-to none -q)

mkdir "$folder/work"
"$program" generate wake --size "$size" -o "$folder/in" > "$log"
checksums() { (cd "$1" && sha256sum ./*); }
seconds() { date +%s.%N; }
calculate() { awk "BEGIN { printf \"%.0f\", $1 }"; }

"$program" "${convert[@]}" > "$log" 2>&1
checksums "$cache" > "$folder/expected"
rm -rf "$cache"
"${mpirun[@]}" -n 3 "$dying" "${grid[@]}" "$cache" -1 0 0 > "$folder/passes" 2> "$log"
checksums "$cache" | cmp - "$folder/expected"
echo "undisturbed, 3 ranks, seconds: $(tr '\n' ' ' < "$folder/passes")"

failed=0 ended=0 resumed=0 pass=0 tried=0
format='%-8s %5s %9s  %6s  %7s  %-12s %6s  %s\n'
printf "$format" pass rank 'at [ms]' status 'takes' 'left behind' 'then by' result
while read -r name duration; do
  for ((n = 0; n < kills && pass % every == 0; ++n)); do
    tried=$((tried + 1))
    rm -rf "$folder/work"/*
    delay=$(calculate "1e6 * $duration * ($n + $RANDOM / 32768) / $kills")
    victim=$((RANDOM % 3)) ranks=$((RANDOM % 4 + 1)) status=0 result=equal left=nothing
    start=$(seconds)
    timeout 300 "${mpirun[@]}" -n 3 "$dying" "${grid[@]}" "$cache" "$victim" "$pass" "$delay" > "$log" 2>&1 < /dev/null || status=$?
    took=$(calculate "$(seconds) - $start")
    [ "$status" = 0 ] || ended=$((ended + 1))
    if [ "$status" = 0 ] && [ -d "$cache" ]; then
      left='the cache'
    else
      [ -z "$(ls -A "$folder/work")" ] || left=unfinished
      "${mpirun[@]}" -n "$ranks" "$program" "${convert[@]}" --resume --overwrite --stats "$statistics" > "$log" 2>&1 < /dev/null ||
        result=FAILED
      if grep -q '"resumed": true' "$statistics" 2> /dev/null; then
        result="$result, resumed"
        resumed=$((resumed + 1))
      fi
    fi
    checksums "$cache" 2> /dev/null | cmp -s - "$folder/expected" || result=DIFFERENT
    [ "$(find "$folder/work" -mindepth 1 -maxdepth 1 | wc -l)" = 1 ] || result="$result, LEFTOVERS"
    [ "$status" != 124 ] || result="$result, DID NOT END"
    printf "$format" "$name" "$victim" "$(calculate "$delay / 1000")" "$status" "$took" "$left" "$ranks" "$result"
    [[ ! "$result" =~ [A-Z] ]] || failed=1
  done
  pass=$((pass + 1))
done < "$folder/passes"
echo "$ended of $tried were ended before they were done; $resumed were resumed"
[ $ended -gt 0 ] || failed=1
exit $failed
