#!/usr/bin/env bash
# Ends conversions and additions of a scalar, by SIGKILL and by SIGINT, at moments spread over their duration; looks
# at what is left; has them done after all, and compares the result with that of one that no one disturbed. Prints a
# table; exit status 1 if anything is not as it must be (words in capitals).
#
#   tests/kill_conversion.sh [PROGRAM [SIZE [MOMENTS [FOLDER]]]]
#
# MOMENTS of each kind (20). SIZE is the generated grid's, or mesh:100 for an unstructured grid of 100^3 hexahedra, which needs
# numpy. Without SIZE the grid has 320x250x200 (16 M) nodes, and with `mesh` those cells; both only with CURVISPLAT_WHOLE, else exit
# status 77. FOLDER has room for 150 bytes a node.
set -euo pipefail

program=${1:-build/release/tools/curvisplat}
size=${2:-grid}
if [[ $size == grid || $size == mesh ]]; then
  [[ -v CURVISPLAT_WHOLE ]] || { echo "skipped: only with tools/test.sh --whole"; exit 77; }
  if [ "$size" = grid ]; then size=320x250x200; else size=mesh:100; fi
fi
moments=${3:-20}
folder=$(mktemp -d "${4:-/tmp}/kill_conversion.XXXXXX")
trap 'rm -rf "$folder"' EXIT
trap 'exit 1' INT TERM

cache=$folder/work/a.splats
log=$folder/log
statistics=$folder/stats.json
input=("$folder/in.xyz" "$folder/in.fun")
scalar=1 added=i
if [[ $size == mesh:* ]]; then
  input=("$folder/in.vtu") scalar=f added=g
  if ! /usr/bin/python3 -c 'import numpy' 2> /dev/null; then
    echo "skipped: no python3-numpy"
    exit 77
  fi
fi
convert=(convert "${input[@]}" -o "$cache" --scalar "$scalar" --memory 512M)
add=(convert "${input[@]}" --add-scalar "$added" --to "$cache" --memory 512M)

mkdir "$folder/work"
if [[ $size == mesh:* ]]; then
  /usr/bin/python3 "$(dirname "$0")/../bench/big_mesh.py" "${input[0]}" --size "${size#mesh:}" --second
else
  "$program" generate wake --size "$size" -o "$folder/in" > "$log"
fi

checksums() { (cd "$1" && sha256sum ./*); }
seconds() { date +%s.%N; }
# calculate AWK_EXPRESSION
calculate() { awk "BEGIN { printf \"%.3f\", $1 }"; }
# is FOLDER LIST: whether it holds these files, and no others
is() { [ -d "$1" ] && checksums "$1" | cmp -s - "$2"; }
# holds FOLDER LIST: whether it holds these files, and perhaps others
holds() { (cd "$1" 2> /dev/null && sha256sum --status -c "$2" 2> /dev/null); }
opens() { "$program" info "$cache" > "$log" 2>&1; }
# run OPTION ...
run() { "$program" "$@" --stats "$statistics" > "$log" 2>&1; }
number() { sed -n "s/.*\"$1\": \([0-9]*\).*/\1/p" "$statistics"; }

# end_after SECONDS SIGNAL OPTION ...: sets $status. In a shell of its own, whose word on the killing goes to the log
# too; with SIGINT as a terminal has it, whatever this script was started with. In the foreground timeout signals the
# program once; else its whole group as well, and a second signal is one to end at once.
end_after() {
  status=0
  (timeout --foreground --preserve-status -s "$2" "$1" env --default-signal=INT "$program" "${@:3}"; exit $?) \
    > "$log" 2>&1 || status=$?
}

start=$(seconds)
run "${convert[@]}"
convert_s=$(calculate "$(seconds) - $start")
checksums "$cache" > "$folder/one"
start=$(seconds)
run "${add[@]}"
add_s=$(calculate "$(seconds) - $start")
checksums "$cache" > "$folder/both"
echo "undisturbed: conversion $convert_s s, addition $add_s s"

failed=0 ended=0
# row WHAT SIGNAL MOMENT STATUS LEFT DONE_AGAIN SECONDS RESULT
row() {
  printf '%-8s %-5s %9s  %6s   %-22s %-16s %8s   %s\n' "$@"
  [[ "$5$8" =~ [A-Z] ]] && failed=1
  [ "$4" = 0 ] || ended=$((ended + 1))
  return 0
}
printf '%-8s %-5s %9s  %6s   %-22s %-16s %8s   %s\n' job signal 'at [s]' status 'left behind' 'bricks kept' 'in [s]' result

# What is beside the cache. Hidden files are there by no means.
beside() { find "$folder/work" -mindepth 1 -maxdepth 1 ! -path "$cache" | wc -l; }

# end_conversion SIGNAL STATUS MOMENT
end_conversion() {
  rm -rf "$folder/work"/*
  end_after "$3" "$1" "${convert[@]}"
  local left kept='' took=0 result=equal
  if is "$cache" "$folder/one" && [ "$(beside)" = 0 ]; then
    left='the cache'
    [ "$status" = 0 ] || [ "$status" = "$2" ] || left=STATUS
  elif opens; then
    left='a cache and more'  # put into place, and not cleared up after
    holds "$cache" "$folder/one" || left='WRONG CACHE'
    [ "$1" = KILL ] || left=LEFTOVERS
  elif [ "$(beside)" = 0 ]; then
    left=nothing
  else
    left='unfinished'
  fi
  [ "$left" = 'the cache' ] || [ "$status" = "$2" ] || left="STATUS $status"
  if [ "$left" != 'the cache' ]; then
    start=$(seconds)
    run "${convert[@]}" --resume || result=FAILED
    took=$(calculate "$(seconds) - $start")
    kept='begun anew'
    if grep -q '"resumed": true' "$statistics"; then kept="$(number resumed_bricks) of $(number bricks)"; fi
  fi
  is "$cache" "$folder/one" || result=DIFFERENT
  [ "$(beside)" = 0 ] || result="$result, LEFTOVERS"
  row convert "$1" "$3" "$status" "$left" "$kept" "$took" "$result"
}

# end_addition SIGNAL STATUS MOMENT
end_addition() {
  rm -rf "$folder/work"/*
  cp -r "$folder/one.splats" "$cache"
  end_after "$3" "$1" "${add[@]}"
  local left took=0 result=equal
  if is "$cache" "$folder/both" && [ "$(beside)" = 0 ]; then
    left='both scalars'
  elif is "$cache" "$folder/one" && [ "$(beside)" = 0 ]; then
    left='one scalar'
  elif holds "$cache" "$folder/both"; then
    left='both, and more'
  elif holds "$cache" "$folder/one"; then
    left='one, and more'
  else
    left='WRONG CACHE'
  fi
  opens || left="$left, NOT TO BE OPENED"
  [ "$1" = KILL ] || [[ "$left" != *more ]] || left=LEFTOVERS
  [ "$status" = "$2" ] || [ "$left $status" = 'both scalars 0' ] || left="STATUS $status"
  if [[ "$left" != both* ]]; then
    start=$(seconds)
    run "${add[@]}" || result=FAILED
    took=$(calculate "$(seconds) - $start")
    is "$cache" "$folder/both" || result=DIFFERENT
    [ "$(beside)" = 0 ] || result="$result, LEFTOVERS"
  fi
  row addition "$1" "$3" "$status" "$left" '' "$took" "$result"
}

# each KIND DURATION SIGNAL STATUS: one at random in each of equal parts of the duration.
each() {
  local n moment
  for ((n = 0; n < moments; ++n)); do
    moment=$(calculate "$2 * ($n + $RANDOM / 32768) / $moments + 0.001")
    "$1" "$3" "$4" "$moment"
  done
}

rm -rf "$cache"
run "${convert[@]}"
mv "$cache" "$folder/one.splats"
each end_conversion "$convert_s" KILL 137
each end_conversion "$convert_s" INT 130
each end_addition "$add_s" KILL 137
each end_addition "$add_s" INT 130
echo "$ended of $((4 * moments)) were ended before they were done"
[ $ended -gt 0 ] || failed=1
exit $failed
