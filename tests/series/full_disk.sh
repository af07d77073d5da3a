#!/usr/bin/env bash
# Follows a simulation until the disk is full, a small one of its own: one line, a whole cache of the steps so far, and
# nothing else; with space it goes on.
#
#   full_disk.sh PROGRAM
#
# Exit status 77 (skipped) where the system lets nobody mount a tmpfs in a namespace.
set -euo pipefail

program=$(realpath "$1")
if [ "${2:-}" != inside ]; then
  unshare -rm true 2> /dev/null && unshare -rm mount -t tmpfs none /tmp 2> /dev/null || exit 77
  exec unshare -rm "$0" "$program" inside
fi

fail() { echo "FAILED: $*"; exit 1; }
folder=$(mktemp -d)
trap 'umount "$folder/disk" 2> /dev/null; rm -rf "$folder"' EXIT
mkdir "$folder/disk"
mount -t tmpfs -o size=200k none "$folder/disk"
"$program" generate wake --size 32x24x16 --steps 12 -o "$folder/w" > /dev/null
touch -d '1 hour ago' "$folder"/w*
cache=$folder/disk/a.splats
follow=(convert "$folder/w.xyz" "$folder/w_*.fun" --follow --until 12 --refine 1 -o "$cache" --tmp "$folder")

# Once it is foreseen, once it happens.
for preflight in '' --no-preflight; do
  rm -rf "$folder/disk"/*
  status=0
  "$program" "${follow[@]}" $preflight > "$folder/out" 2> "$folder/err" || status=$?
  cat "$folder/err"
  [ $status = 1 ] || fail "status $status"
  [ "$(wc -l < "$folder/err")" = 1 ] || fail "more than one line"
  grep -q "$folder/disk[^ ]*: .*make room" "$folder/err" || fail "the folder of the cache, or what helps, is not named"
  ! grep -qE '\.part\b|\.partial|\.tmp|\.add-' "$folder/err" || fail "a temporary file is named"
  steps=$(grep -c '^step' "$folder/out")
  [ "$steps" -ge 2 ] && [ "$steps" -lt 12 ] || fail "$steps steps"
  grep -q "step $steps .*$(printf 'w_%04d.fun' "$steps")" "$folder/err" || fail "the step is not named"
  "$program" info "$cache" --verify > /dev/null || fail "the cache is damaged"
  [ -z "$(find "$folder/disk" -name '*.part' -o -name '*.tmp*')" ] || fail "left $(ls "$cache")"
done

mount -o remount,size=40m "$folder/disk"
"$program" "${follow[@]}" --resume > /dev/null
"$program" convert "$folder/w.xyz" "$folder/w_*.fun" --refine 1 -o "$folder/whole.splats" > /dev/null
diff -r "$cache" "$folder/whole.splats" || fail "the cache differs from one that had space"
echo "full after $steps steps; then whole"
