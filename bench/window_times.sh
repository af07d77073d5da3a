#!/usr/bin/env bash
# How long the window takes, on a display without a screen: until something of CACHE is on it, from a key to the
# screen while the picture is refined (screenshots included: some 50 ms), and from Escape to the end.
# Needs Xvfb, xdotool, xwd and ImageMagick.
set -euo pipefail
cache=$(realpath "${1:?usage: bench/window_times.sh CACHE}")
program=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)/build/release/tools/curvisplat
work=$(mktemp -d)
export DISPLAY=:$((100 + $$ % 20000)) XDG_CONFIG_HOME=$work
Xvfb "$DISPLAY" -screen 0 1280x900x24 -noreset >/dev/null 2>&1 &
server=$!
trap 'kill $server 2>/dev/null; rm -rf "$work"' EXIT
until xdotool getmouselocation >/dev/null 2>&1; do :; done

now() { date +%s.%N; }
since() { echo "$(now) - $1" | bc; }
shot() { xwd -root -silent -out "$work/shot.xwd"; }
of() { convert "xwd:$work/shot.xwd" -crop "$1" -format "%[fx:$2]" info:; }

start=$(now)
(cd "$work" && exec "$program" view "$cache" --size 1200x800 >/dev/null 2>&1) &
window=$!
for ((n = 0; n < 200; ++n)); do
  shot
  taken=$(since "$start")
  [[ $(of 500x500+500+150 "standard_deviation>0.01?1:0") == 1 ]] && break
done
echo "something on the screen after ${taken} s"
sleep 1
for key in 1 2 3 4 5 6; do
  shot
  before=$(of 200x200+20+300 mean)
  start=$(now)
  xdotool key h
  for ((n = 0; n < 200; ++n)); do
    shot
    taken=$(since "$start")
    [[ $(of 200x200+20+300 mean) != "$before" ]] && break
  done
  echo "key $key on the screen after ${taken} s"
  sleep 0.7
done
grep VmHWM "/proc/$window/status"
start=$(now)
xdotool key Escape
wait $window
echo "closed after $(since "$start") s"
