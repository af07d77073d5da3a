#!/usr/bin/env bash
# Long runs: an orbit of many frames over a cache many times as large as its memory, then a window that is turned,
# zoomed, edited and resized without end. Prints what the process had along the way: memory, open files, threads;
# exit status 1 where they grow, or where the last picture is not the first.
#
#   tests/soak.sh [--short] [PROGRAM [FOLDER [CACHE]]]
#
# In full: 1,000 frames with 128 MiB over a cache of 3.5 GB, and a window for 10 minutes; FOLDER has room for 20 GB,
# and CACHE, if given, is used in place of the one that is otherwise made there (with python3, which makes it hard to
# compress). --short: 30 frames and some seconds.
set -euo pipefail

form=full
[ "${1:-}" != --short ] || { form=short; shift; }
program=$(realpath "${1:-build/release/tools/curvisplat}")
folder=$(mktemp -d "$(realpath "${2:-/tmp}")/soak.XXXXXX")
cache=${3:-}
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
started=()
finish() {
  for pid in "${started[@]}"; do kill "$pid" 2> /dev/null || true; done
  rm -rf "$folder"
}
trap finish EXIT
trap 'exit 1' INT TERM
export XDG_CONFIG_HOME=$folder/config

if [ $form = full ]; then
  size=936x468x468 window_size=256x128x128 frames=1000 memory=128M picture=600x600 splats=400000 session_s=600
  interval_s=2 slack=4
else
  size=96x48x48 window_size=64x32x32 frames=30 memory=52M picture=160x160 splats=200000 session_s=5
  interval_s=0.1 slack=64  # of so few rounds, the first half still warms up
fi
failed=0
fail() {
  echo "FAILED: $*"
  failed=1
}
quietly() { "$@" > "$folder/log" 2>&1 || { cat "$folder/log"; exit 1; }; }

# made NAME SIZE SCALAR...: a cache; in full form one that does not compress, as large as its grid.
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

# watch PID FILE: a line every so often, as long as it lives: seconds, KiB in memory, open files, threads.
watch() {
  local pid=$1 begin
  begin=$(date +%s.%N)
  while kill -0 "$pid" 2> /dev/null; do
    local memory threads files
    memory=$(awk '/^VmRSS/ { print $2 }' "/proc/$pid/status" 2> /dev/null) || break
    threads=$(awk '/^Threads/ { print $2 }' "/proc/$pid/status" 2> /dev/null) || break
    files=$(find "/proc/$pid/fd" -mindepth 1 2> /dev/null | wc -l) || break
    [ -z "$memory" ] || echo "$(date +%s.%N) $begin $memory $files $threads" >> "$2"
    sleep $interval_s
  done
}

# judge FILE SLACK: a table of it; its last quarter may have no more than its second. Memory: 4 % and SLACK MiB, for
# pages that come and go.
judge() {
  awk -v slack="$2" '
    { t[NR] = $1 - $2; memory[NR] = $3 / 1024; files[NR] = $4; threads[NR] = $5 }
    function most(values, from, to,   n, m) { m = 0; for (n = from; n <= to; ++n) if (values[n] > m) m = values[n]; return m }
    END {
      if (NR < 8) { print "FAILED: too short to be judged"; exit 1 }
      rows = NR < 12 ? NR : 12
      print "      seconds   memory [MiB]   open files   threads"
      for (row = 0; row < rows; ++row) {
        n = 1 + int(row * (NR - 1) / (rows - 1))
        printf "%13.1f %14.1f %12d %9d\n", t[n], memory[n], files[n], threads[n]
      }
      half = int(NR / 2); quarter = int(NR / 4); last = NR - quarter
      before = most(memory, quarter, half); after = most(memory, last, NR)
      printf "most memory: %.1f MiB in the second quarter, %.1f in the last\n", before, after
      bad = 0
      if (after > 1.04 * before + slack) { print "FAILED: memory grows"; bad = 1 }
      if (most(files, last, NR) > most(files, quarter, half)) { print "FAILED: open files grow"; bad = 1 }
      if (most(threads, last, NR) > most(threads, quarter, half)) { print "FAILED: threads grow"; bad = 1 }
      exit bad
    }' "$1" || failed=1
}

# The orbit. Two turns: every frame of the first comes again, after half of all frames.
if [ -z "$cache" ]; then
  made orbit "$size" f
  cache=$folder/orbit.splats
fi
echo "orbit: $frames frames of $picture with --memory $memory over $(du -sh "$cache" | cut -f 1)"
view=(--parallel-scale 0.3 --lod-pixels 2 --max-splats "$splats" --size "$picture" --memory "$memory")
"$program" render "$cache" -o "$folder/frame_%04d.png" --position 4,4,3 --orbit 720 --frames "$frames" \
  "${view[@]}" --stats "$folder/stats.json" > "$folder/render.log" 2>&1 &
pid=$!
started+=("$pid")
watch "$pid" "$folder/orbit.txt"
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

# The window.
for needed in Xvfb xdotool; do
  if ! command -v $needed > /dev/null; then
    echo "window: skipped, $needed is not installed"
    exit $failed
  fi
done
made window $window_size f j
cd "$folder"
mkfifo display
Xvfb -displayfd 3 -screen 0 1000x700x24 -noreset -nolisten tcp 3> display 2> xvfb.log &
started+=($!)
DISPLAY=:$(head -n 1 display)
export DISPLAY
"$program" view window.splats --size 900x600 --memory 96M > view.log 2> view.err &
pid=$!
started+=("$pid")
do_() { xdotool "$@" > xdotool.log 2>&1 || { cat xdotool.log view.err; exit 1; }; }
# saved NAME: the final picture, once it is there.
saved() {
  local before after
  before=$(find . -maxdepth 1 -name 'window_*.png' | wc -l)
  for ((try = 0; try < 600; ++try)); do
    [ $((try % 50)) -ne 0 ] || do_ mousemove 600 300 key p
    after=$(find . -maxdepth 1 -name 'window_*.png' | wc -l)
    if [ "$after" -gt "$before" ]; then
      mv "$(printf 'window_%04d.png' "$after")" "$1"
      return
    fi
    kill -0 $pid 2> /dev/null || { cat view.err; exit 1; }
    sleep 0.1
  done
  fail "no picture was saved"
}
drag() { do_ mousemove 600 300 mousedown "$1" mousemove 640 320 mousemove 690 350 mousemove "$2" "$3" mouseup "$1" mousemove 600 300; }

do_ mousemove 600 300
saved first_try.png
do_ key z key r
saved first.png
watch "$pid" "$folder/window.txt" &
started+=($!)
end=$((SECONDS + session_s))
rounds=0
while [ $SECONDS -lt $end ]; do
  drag 1 720 420
  do_ click --repeat 5 4
  drag 2 640 340
  do_ click --repeat 5 5 key o
  # A point of the function, another scalar, and both back.
  do_ mousemove 100 50 click 1 mousemove 600 300 sleep 0.1 mousemove 100 50 click 3 mousemove 600 300
  do_ mousemove 100 17 click 1 sleep 0.3 mousemove 60 58 click 1 mousemove 600 300 sleep 0.3 key c
  do_ mousemove 100 17 click 1 sleep 0.3 mousemove 60 38 click 1 mousemove 600 300 sleep 0.3 key c
  do_ search --onlyvisible --name curvisplat windowsize 800 500
  do_ key o
  drag 3 600 340
  do_ search --onlyvisible --name curvisplat windowsize 900 600
  do_ key z key r
  rounds=$((rounds + 1))
done
saved last.png
do_ key Escape
wait "$pid" || fail "view: $(cat view.err)"
echo "window: $rounds rounds in $session_s s; scalars shown: $(grep -o -- '--scalar [a-z]' view.log | sort | uniq -c | tr '\n' ' ')"
judge "$folder/window.txt" $slack
cmp -s first.png last.png || fail "the window's last picture is not its first"
[ "$(grep -o -- '--scalar [a-z]' view.log | sort -u | wc -l)" -eq 2 ] || fail "the scalar never changed"
exit $failed
