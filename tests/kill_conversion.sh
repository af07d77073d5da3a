#!/usr/bin/env bash
# Kills a conversion (SIGKILL) at moments spread over its duration, resumes it, and compares the result with
# that of a conversion that no one disturbed. Prints a table; exit status 1 if anything is not as it must be.
#
#   tests/kill_conversion.sh [PROGRAM [SIZE [MOMENTS [FOLDER]]]]
#
# SIZE is the generated grid's (320x250x200: 16 M nodes), FOLDER has room for 100 bytes a node.
set -euo pipefail

program=${1:-build/release/tools/curvisplat}
size=${2:-320x250x200}
moments=${3:-20}
folder=$(mktemp -d "${4:-/tmp}/kill_conversion.XXXXXX")
trap 'rm -rf "$folder"' EXIT
trap 'exit 1' INT TERM

"$program" generate wake --size "$size" -o "$folder/in" > "$folder/log"

# convert NAME [OPTION ...]
convert() {
  output=$folder/$1
  shift
  "$program" convert "$folder/in.xyz" "$folder/in.fun" -o "$output" --memory 512M "$@"
}
checksums() { (cd "$1" && sha256sum ./*); }
seconds() { date +%s.%N; }
# calculate AWK_EXPRESSION
calculate() { awk "BEGIN { printf \"%.3f\", $1 }"; }

start=$(seconds)
convert undisturbed.splats > "$folder/log" 2>&1
duration=$(calculate "$(seconds) - $start")
checksums "$folder/undisturbed.splats" > "$folder/expected"
echo "undisturbed: $duration s"

echo "killed at [s]   opens   bricks kept      resumed in [s]   checksums"
failed=0
n=0
while [ "$n" -lt "$moments" ]; do
  # One at random in each of equal parts of the duration.
  random=$((RANDOM * 2))
  moment=$(calculate "$duration * ($n + $random / 65536) / $moments")
  killed=yes
  # In a shell of its own, whose word on the killing goes to the log too.
  (timeout -s KILL "$moment" "$program" convert "$folder/in.xyz" "$folder/in.fun" \
    -o "$folder/killed.splats" --memory 512M; exit $?) > "$folder/log" 2>&1 && killed=no
  opens=no
  "$program" info "$folder/killed.splats" > "$folder/log" 2>&1 && opens=whole
  if [ "$killed" = yes ] && [ "$opens" = whole ]; then
    # Killed after it was put into place: then it is the one.
    checksums "$folder/killed.splats" | cmp -s - "$folder/expected" || opens=WRONGLY
  fi
  took=0
  if [ "$opens" = no ]; then
    start=$(seconds)
    convert killed.splats --resume --stats "$folder/stats.json" > "$folder/log" 2>&1 || cat "$folder/log"
    took=$(calculate "$(seconds) - $start")
    kept=$(sed -n 's/.*"resumed_bricks": \([0-9]*\).*/\1/p' "$folder/stats.json")
    kept="$kept of $(sed -n 's/.*"bricks": \([0-9]*\).*/\1/p' "$folder/stats.json")"
    grep -q '"resumed": true' "$folder/stats.json" || kept="begun anew"
  else
    kept=all
  fi
  same=equal
  checksums "$folder/killed.splats" | cmp -s - "$folder/expected" || same=DIFFERENT
  left=$(find "$folder" -maxdepth 1 -name 'killed.splats.*' | wc -l)
  [ "$left" = 0 ] || same="$same, LEFTOVERS"
  printf '%13.3f   %-7s %-16s %14.1f   %s\n' "$moment" "$opens" "$kept" "$took" "$same"
  [ "$same" = equal ] && [ "$opens" != WRONGLY ] || failed=1
  rm -rf "$folder"/killed.splats*
  n=$((n + 1))
done
exit $failed
