#!/usr/bin/env bash
# A series played forwards, backwards and at random, in memory that holds its steps' values and in memory that does not. Prints
# what each process had along the way: memory, open files, threads; exit status 1 where they grow (in full), or where a step's
# picture depends on what was drawn before.
#
#   tests/soak/steps.sh [--short | --full] [PROGRAM [FOLDER]]
#
# In full: 1,000 steps. In short: 12.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

if [ $form = full ]; then steps=1000 size=64x48x24 memories="256M 56M" interval_s=0.25; else steps=12 size=40x32x16 memories="64M 56M" interval_s=0.05; fi
quietly "$program" generate wake --size "$size" --steps "$steps" -o "$folder/w"
quietly "$program" convert "$folder/w.xyz" "$folder/w_*.fun" -o "$folder/w.splats"
rm "$folder"/w*.fun
echo "$steps steps of $size, $(du -sm "$folder/w.splats" | cut -f 1) MiB"

# path NAME: a camera that stands, and a key frame for each step.
/usr/bin/env python3 - "$folder" "$steps" << 'PATHS'
import json, random, sys
folder, steps = sys.argv[1], int(sys.argv[2])
random.seed(1)
orders = {"forwards": list(range(steps)), "backwards": list(range(steps))[::-1], "random": random.sample(range(steps), steps)}
camera = {"position": [3, 0, 20], "focal_point": [3, 0, 2], "view_up": [0, 1, 0], "parallel_scale": 5}
for name, order in orders.items():
    frames = [{"time": n, "series_time": step, **camera} for n, step in enumerate(order)]
    json.dump({"key_frames": frames}, open(f"{folder}/{name}.json", "w"))
    open(f"{folder}/{name}.order", "w").write("".join(f"{step}\n" for step in order))
PATHS

for memory in $memories; do
  for order in forwards backwards random; do
    rm -rf "${folder:?}/$order"
    mkdir "$folder/$order"
    "$program" render "$folder/w.splats" -o "$folder/$order/%04d.png" --path "$folder/$order.json" --frames "$steps" \
      --range 0,1 --opacity-unit 0.2 --lod-pixels 0 --size 96x96 --memory "$memory" > "$folder/render.log" 2>&1 &
    pid=$!
    rm -f "$folder/$order.txt"
    watch "$pid" "$folder/$order.txt" "$interval_s" "$folder/$order/0000.png"
    if wait "$pid"; then echo "$order, $memory: $(cat "$folder/render.log")"; else fail "render: $(cat "$folder/render.log")"; fi
    # In short the steps are still being read in the last quarter: memory grows, as it should.
    [ $form = short ] || judge "$folder/$order.txt" 4
    n=0 differing=0
    while read -r step; do
      cmp -s "$folder/$order/$(printf '%04d.png' $n)" "$folder/forwards/$(printf '%04d.png' "$step")" || differing=$((differing + 1))
      n=$((n + 1))
    done < "$folder/$order.order"
    [ $differing -eq 0 ] || fail "$order: $differing pictures are not those of their step"
  done
done
exit $failed
