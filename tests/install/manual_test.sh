#!/usr/bin/env bash
# Manual pages and bash completion, as the program writes them: pages that man reads without a warning, and every
# option of --help in both.
#
#   tests/install/manual_test.sh PROGRAM
set -euo pipefail

program=$(realpath "$1")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
failed=0
fail() {
  echo "FAILED: $*"
  failed=1
}

"$program" manual "$folder"
commands=$("$program" --help | sed -n '/^Subcommands:/,$ s/^  \([a-z]\+\) .*/\1/p')
[[ $(wc -w <<< "$commands") -ge 7 ]] || fail "subcommands in --help: $commands"

for page in "$folder"/*.1; do
  warnings=$(LC_ALL=C.UTF-8 MANWIDTH=80 man --warnings -E UTF-8 -l -Tutf8 -Z "$page" 2>&1 > "$folder/shown")
  [[ -z $warnings ]] || fail "$(basename "$page"): $warnings"
  [[ -s $folder/shown ]] || fail "$(basename "$page"): man shows nothing"
done
# text PAGE: what man shows, without its own hyphenation
text() { LC_ALL=C.UTF-8 MANWIDTH=1000 man --no-hyphenation -l "$1" 2> /dev/null | col -bx; }
text "$folder/curvisplat.1" > "$folder/text"
for command in $commands; do
  grep -q "^ *curvisplat-$command(1)" "$folder/text" || fail "curvisplat.1 does not name $command"
done

bash -n "$folder/curvisplat.bash" || fail "curvisplat.bash does not parse"
source "$folder/curvisplat.bash"
# completed WORD ...: what completes the last word
completed() {
  COMP_WORDS=("$@")
  COMP_CWORD=$(($# - 1))
  _curvisplat
  echo "${COMPREPLY[*]}"
}
completes() {
  local expected=$1
  shift
  [[ $(completed "$@") == "$expected" ]] || fail "'$*' completes to '$(completed "$@")', not '$expected'"
}
completes "$(tr '\n' ' ' <<< "$commands" | sed 's/ $//')" curvisplat ''
completes 'render' curvisplat ren
completes '' curvisplat manu
completes '--version' curvisplat --v
completes '--lod-pixels' curvisplat render a.splats --lod
completes '4 8 none' curvisplat convert grid.xyz --records ''
completes 'big' curvisplat info --byte-order b
completes 'none' curvisplat convert --records = n
# Files, by bash.
completes '' curvisplat render a.sp
completes '' curvisplat render -o ''

for command in $commands; do
  text "$folder/curvisplat-$command.1" > "$folder/text"
  options=$("$program" "$command" --help | grep -oE '^  (-[a-z],)?--[a-z-]+' | grep -oE '\-\-[a-z-]+')
  all=" $(completed curvisplat "$command" -) "
  for option in $options; do
    grep -qE "^ *(-[a-z], )?$option( |$)" "$folder/text" || fail "curvisplat-$command.1 lacks $option"
    [[ $all == *" $option "* ]] || fail "$command: $option is not completed"
  done
done
[[ $failed -eq 1 ]] || echo "pages and completion of: ${commands//$'\n'/ }"
exit $failed
