#!/usr/bin/env bash
# Kills one rank of a conversion by several, at moments spread over its duration; has it done by another number of
# ranks, and compares the result with one process's. Prints a table; exit status 1 if a result differs (words in
# capitals), 77 if there is no mpirun.
#
#   tests/kill_ranks.sh [PROGRAM [SIZE [MOMENTS [FOLDER]]]]
#
# SIZE is the generated grid's (160x120x100: 2 M nodes), FOLDER has room for 250 bytes a node.
set -euo pipefail

program=$(realpath "${1:-build/release/tools/curvisplat}")
size=${2:-160x120x100}
moments=${3:-20}
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
convert=(convert "$folder/in.xyz" "$folder/in.fun" -o "$cache" --threads 1 --memory 256M)
mpirun=(mpirun --oversubscribe --allow-run-as-root --bind-to none -q)

mkdir "$folder/work" "$folder/pids"
"$program" generate wake --size "$size" -o "$folder/in" > "$log"
checksums() { (cd "$1" && sha256sum ./*); }
seconds() { date +%s.%N; }
calculate() { awk "BEGIN { printf \"%.3f\", $1 }"; }

# A rank that leaves its process's number behind.
cat > "$folder/rank.sh" << END
#!/bin/sh
echo \$\$ > "$folder/pids/\$OMPI_COMM_WORLD_RANK"
exec "$program" "\$@"
END
chmod +x "$folder/rank.sh"

"$program" "${convert[@]}" > "$log" 2>&1
checksums "$cache" > "$folder/expected"
rm -rf "$cache"
start=$(seconds)
"${mpirun[@]}" -n 3 "$program" "${convert[@]}" > "$log" 2>&1
convert_s=$(calculate "$(seconds) - $start")
checksums "$cache" | cmp - "$folder/expected"
echo "undisturbed, 3 ranks: $convert_s s"

failed=0 ended=0
format='%5s %9s  %6s  %8s  %-12s %6s  %s\n'
printf "$format" rank 'at [s]' status 'ends in' 'left behind' 'then by' result
for ((n = 0; n < moments; ++n)); do
  rm -rf "$folder/work"/* "$folder/pids"/*
  moment=$(calculate "$convert_s * ($n + $RANDOM / 32768) / $moments")
  victim=$((RANDOM % 3)) ranks=$((RANDOM % 4 + 1)) status=0 result=equal left=nothing
  timeout 300 "${mpirun[@]}" -n 3 "$folder/rank.sh" "${convert[@]}" > "$log" 2>&1 &
  job=$!
  for ((wait = 0; wait < 100; ++wait)); do
    [ ! -s "$folder/pids/$victim" ] || break
    sleep 0.02
  done
  sleep "$moment"
  kill -KILL "$(cat "$folder/pids/$victim")" 2> /dev/null || true
  start=$(seconds)
  wait $job || status=$?
  took=$(calculate "$(seconds) - $start")
  [ "$status" = 0 ] || ended=$((ended + 1))
  if [ -d "$cache" ] && [ "$status" = 0 ]; then
    left='the cache'
  else
    [ -z "$(ls -A "$folder/work")" ] || left=unfinished
    "${mpirun[@]}" -n "$ranks" "$program" "${convert[@]}" --resume --overwrite --stats "$statistics" > "$log" 2>&1 || result=FAILED
    if grep -q '"resumed": true' "$statistics" 2> /dev/null; then result="$result, resumed"; fi
  fi
  checksums "$cache" 2> /dev/null | cmp -s - "$folder/expected" || result=DIFFERENT
  [ "$(find "$folder/work" -mindepth 1 -maxdepth 1 | wc -l)" = 1 ] || result="$result, LEFTOVERS"
  [ "$(calculate "$took < 30")" = 1.000 ] || result="$result, SLOW END"
  printf "$format" "$victim" "$moment" "$status" "$took" "$left" "$ranks" "$result"
  [[ ! "$result" =~ [A-Z] ]] || failed=1
done
echo "$ended of $moments were ended before they were done"
[ $ended -gt 0 ] || failed=1
exit $failed
