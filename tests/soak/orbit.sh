#!/usr/bin/env bash
# An orbit of many frames over a cache many times as large as its memory. Prints what the process had along the way:
# memory, open files, threads; exit status 1 where they grow, or where a frame is not what it was a turn before.
#
#   tests/soak/orbit.sh [--short | --full] [PROGRAM [FOLDER [CACHE]]]
#
# In full: 1,000 frames with 128 MiB over a cache of 3.5 GB; FOLDER has room for 20 GB, and CACHE, if given, is used in
# place of the one that is otherwise made there (with python3, which makes it hard to compress). In short: 16 frames.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

if [ $form = full ]; then
  grid=936x468x468 frames=1000 memory=128M picture=600x600 splats=400000 interval_s=2
else
  grid=96x48x48 frames=16 memory=52M picture=160x160 splats=200000 interval_s=0.1
fi

cache=${rest[0]:-}
if [ -z "$cache" ]; then
  made orbit "$grid" f
  cache=$folder/orbit.splats
fi
size=$(du -sm "$cache" | cut -f 1)
[ $form = short ] || [ "$size" -ge $((20 * ${memory%M})) ] ||
  fail "the cache is $size MiB, less than 20 times the memory"
# Two turns: every frame of the first comes again, after half of all frames.
echo "$frames frames of $picture with --memory $memory over $size MiB"
view=(--parallel-scale 0.3 --lod-pixels 2 --max-splats "$splats" --size "$picture" --memory "$memory")
"$program" render "$cache" -o "$folder/frame_%04d.png" --position 4,4,3 --orbit 720 --frames "$frames" \
  "${view[@]}" --stats "$folder/stats.json" > "$folder/render.log" 2>&1 &
pid=$!
watch "$pid" "$folder/orbit.txt" "$interval_s" "$folder/frame_0000.png"
if wait "$pid"; then cat "$folder/render.log"; else fail "render: $(cat "$folder/render.log")"; fi
judge "$folder/orbit.txt" 4
differing=0
for ((n = 0; n < frames / 2; ++n)); do
  cmp -s "$folder/$(printf 'frame_%04d.png' "$n")" "$folder/$(printf 'frame_%04d.png' $((n + frames / 2)))" ||
    differing=$((differing + 1))
done
[ $differing -eq 0 ] || fail "$differing of $((frames / 2)) frames are not what they were a turn before"
quietly "$program" render "$cache" -o "$folder/alone.png" --position 4,4,3 "${view[@]}"
cmp -s "$folder/alone.png" "$folder/$(printf 'frame_%04d.png' $((frames / 2)))" ||
  fail "frame $((frames / 2)) is not what a program of its own draws"
distinct=$(sha256sum "$folder"/frame_*.png | cut -d ' ' -f 1 | sort -u | wc -l)
echo "frames of the second turn that differ from the first: $differing; pictures of $distinct kinds"
[ "$distinct" -gt $((frames / 4)) ] || fail "the camera hardly moves"
exit $failed
