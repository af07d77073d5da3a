#!/usr/bin/env bash
# A window that is turned, zoomed, edited and resized without end. Prints what the process had along the way: memory,
# open files, threads; exit status 1 where they grow, or where the last picture is not the first.
#
#   tests/soak/window.sh [--short | --full] [PROGRAM [FOLDER]]
#
# In full: 10 minutes over a cache of 100 MB; FOLDER has room for 2 GB. In short: 10 seconds, in which memory is still
# being filled. Needs Xvfb and xdotool; exit status 77 without them, and without the form on
# the command line unless CURVISPLAT_WHOLE is set.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

if [ $form = full ]; then
  grid=256x128x128 session_s=600 interval_s=2 slack=4
else
  grid=48x24x24 session_s=10 interval_s=0.25 slack=40
fi
[[ -v CURVISPLAT_WHOLE || ${1:-} == --* ]] || { echo "skipped: only with tools/test.sh --whole"; exit 77; }
for needed in Xvfb xdotool; do
  command -v $needed > /dev/null || { echo "skipped: $needed is not installed"; exit 77; }
done

made wake "$grid" f j
cd "$folder"
mkfifo display
Xvfb -displayfd 3 -screen 0 1000x700x24 -noreset -nolisten tcp 3> display 2> xvfb.log &
DISPLAY=:$(head -n 1 display)
export DISPLAY
: > view.log
export CURVISPLAT_WIDGETS=$PWD/widgets
"$program" view wake.splats --size 900x600 --memory 96M > view.log 2> view.err &
pid=$!

alive() { kill -0 $pid 2> /dev/null || { echo "FAILED: the window is gone: $(cat view.err)"; exit 1; }; }
do_() { xdotool "$@" > xdotool.log 2>&1 || { alive; cat xdotool.log; exit 1; }; }
# until_ TENTHS COMMAND...: waits for it, so many tenths of a second at most.
until_() {
  local tries=$1
  shift
  for ((try = 0; try < tries; ++try)); do
    ! "$@" || return 0
    alive
    sleep 0.1
  done
  return 1
}
# Each answer of the window to a key comes after everything that was done before it.
commands() { wc -l < view.log; }
more_commands() { [ "$(commands)" -gt "$1" ]; }
has_widget() { grep -qsE "^[0-9 -]+ $1\$" widgets; }
# at NAME [ACROSS [DOWN]]: a place in that widget, in percent of its size; waits for it.
at() {
  until_ 1200 has_widget "$1" || fail "there is no widget $1" >&2
  awk -v name="$1" -v across="${2:-50}" -v down="${3:-50}" '{
    x = $1; y = $2; w = $3; h = $4
    for (n = 0; n < 4; ++n) sub(/^[^ ]+ /, "")
    if ($0 == name) print int(x + across / 100 * w), int(y + down / 100 * h)
  }' widgets
}
# asked: what the window shows now, as the command that draws it.
asked() {
  local before place again
  before=$(commands)
  place=$(at picture)
  # One key, and as long as a busy machine takes to answer it. Only the first of all may come before the window hears.
  for ((again = 0; again < 3; ++again)); do
    # shellcheck disable=SC2086
    do_ mousemove $place key ctrl+c
    if until_ $((again == 0 && before == 0 ? 100 : 1200)) more_commands "$before"; then
      until_ 100 more_commands $((before + again)) || true  # an answer for every key, lest the next is taken for one
      tail -n 1 view.log
      return
    fi
  done
  echo "FAILED: the window does not answer" >&2
  exit 1
}
# saved NAME: its final picture.
saved() {
  local name place
  place=$(at picture)
  name=$(printf 'wake_%04d.png' $(($(find . -maxdepth 1 -name 'wake_*.png' | wc -l) + 1)))
  for ((again = 0; again < 4; ++again)); do
    # shellcheck disable=SC2086
    do_ mousemove $place key ctrl+s
    if until_ 1200 test -s "$name"; then
      asked > "$1.command"  # by then the picture is written
      cp "$name" "$1.png"
      return
    fi
  done
  fail "no picture was saved"
}
# press NAME [ACROSS [DOWN [BUTTON]]]: clicks on it.
press() {
  local place
  place=$(at "${@:1:3}")
  # shellcheck disable=SC2086
  do_ mousemove $place click "${4:-1}"
}
# add_point, remove_point: of the opacity curve, at one place.
add_point() { press curve 28 20; }
remove_point() { press curve 28 20 3; }
# drag BUTTON ACROSS DOWN: from the middle of the picture to that place in it, in percent of its size.
drag() {
  local from half to
  from=$(at picture)
  half=$(at picture $(((50 + $2) / 2)) $(((50 + $3) / 2)))
  to=$(at picture "$2" "$3")
  # shellcheck disable=SC2086
  do_ mousemove $from mousedown "$1" mousemove $half mousemove $to mouseup "$1" mousemove $from
}
# show NAME: that scalar. The list and the click on it are for frames of their own: between them, the window is asked.
# A busy window may take the click that opens the list for none: it is clicked again then.
show() {
  local again
  for ((again = 0; again < 10; ++again)); do
    press scalar
    asked > /dev/null
    until_ 100 has_widget "scalar $1" || continue
    press "scalar $1"
    ! asked | grep -qE -- "--scalar $1( |\$)" || return 0
  done
  fail "the scalar $1 cannot be chosen"
}
resize() { do_ search --onlyvisible --name curvisplat windowsize "$1" "$2"; }
# presets_points: the function as it began; a button of the panel's.
presets_points() {
  press "ramp"
  asked > /dev/null
}
# home: everything as it was first. An "o" too few or too many is put right.
home() {
  local again
  show f
  for ((again = 0; again < 4; ++again)); do
    presets_points
    do_ key z key r
    [ "$(asked)" != "$(cat first.command)" ] || return 0
    [ "$again" -eq 0 ] || do_ key o
  done
  fail "the window cannot be brought back: $(asked), not $(cat first.command)"
}

asked > /dev/null  # it hears
# As home() leaves it: the window begins with a function chosen from the data, until one is edited.
add_point
asked > /dev/null
remove_point
show j
show f
presets_points
do_ key z key r
saved first
watch "$pid" window.txt $interval_s &
end=$((SECONDS + session_s))
rounds=0
while [ $SECONDS -lt $end ]; do
  drag 1 70 70
  do_ click --repeat 5 4
  drag 2 57 57
  do_ click --repeat 5 5 key o
  # A point of the function and another scalar; both back.
  add_point
  asked > /dev/null
  remove_point
  show j
  presets_points
  show f
  resize 800 500
  do_ key o
  asked > /dev/null
  drag 3 50 57
  resize 900 600
  do_ key z key r
  asked > /dev/null
  rounds=$((rounds + 1))
done
home
saved last
do_ key ctrl+q
wait "$pid" || fail "view: $(cat view.err)"
echo "$rounds rounds in $session_s s; scalars shown: $(grep -o -- '--scalar [a-z]' view.log | sort | uniq -c | tr '\n' ' ')"
judge window.txt $slack
cmp first.png last.png || fail "the window's last picture is not its first"
[ "$(grep -o -- '--scalar [a-z]' view.log | sort -u | wc -l)" -eq 2 ] || fail "the scalar never changed"
[ ! -s view.err ] || { echo "the window said:"; sort view.err | uniq -c; }
exit $failed
