#!/usr/bin/env bash
# A server whose viewers connect, turn the view, change its function and leave, again and again. Prints what the process had
# after each round of them: memory, open files, threads; exit status 1 where they grow, or where the first picture of a visit is
# not what it was.
#
#   tests/soak/serve.sh [--short | --full] [PROGRAM [FOLDER [SECONDS]]]
#
# In full: 10 minutes, or SECONDS, over a cache of 100 MB and a series of 40 steps; FOLDER has room for 2 GB.
# In short: 5 seconds. Needs python3-websocket; exit status 77 without it.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

if [ $form = full ]; then
  grid=256x128x128 steps=40 seconds=${rest[0]:-600}
else
  grid=48x24x24 steps=4 seconds=${rest[0]:-5}
fi
/usr/bin/python3 -c 'import websocket' 2> /dev/null || { echo "skipped: python3-websocket is not installed"; exit 77; }
made still "$grid" f j
quietly "$program" generate wake --size 48x32x16 --steps "$steps" -o "$folder/w"
quietly "$program" convert "$folder/w.xyz" "$folder/w_*.fun" -o "$folder/w.splats"
rm "$folder"/w*.fun

/usr/bin/python3 "$here/serve_viewers.py" "$program" "$folder/serve.txt" "$seconds" "$folder/still.splats" "$folder/w.splats" ||
  fail "the viewers found the errors above"
judge "$folder/serve.txt" 4
exit $failed
