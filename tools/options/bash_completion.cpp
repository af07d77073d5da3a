#include "tools/options/bash_completion.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <vector>

#include "tools/options/shown_options.h"

namespace curvisplat {
namespace {

std::vector<std::string> optionsOf(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_snames()) names.push_back("-" + name);
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  return names;
}

/// "    convert) options='--output ...' ;;"
std::string branch(const std::string& pattern, const std::string& variable,
                   const std::vector<std::string>& words) {
  return fmt::format("    {}) {}='{}' ;;\n", pattern, variable, fmt::join(words, " "));
}

}  // namespace

std::string bashCompletion(const CLI::App& program) {
  std::vector<std::string> commands;
  std::string options = branch("''", "options", optionsOf(program)), values;
  for (const CLI::App* command : shownCommands(program)) {
    commands.push_back(command->get_name());
    options += branch(command->get_name(), "options", optionsOf(*command));
    for (const CLI::Option* option : command->get_options()) {
      const std::vector<std::string> choices = choicesOf(*option);
      if (choices.empty()) continue;
      for (const std::string& name : option->get_lnames())
        values += branch(command->get_name() + ":--" + name, "values", choices);
    }
  }
  return fmt::format(
      R"(# bash completion of {0}
_{0}() {{
  local current=${{COMP_WORDS[COMP_CWORD]}} previous=${{COMP_WORDS[COMP_CWORD - 1]}}
  local command='' options='' values='' word
  # Of "--option=value" bash makes three words.
  [[ $current != = ]] || current=''
  [[ $previous != = ]] || previous=${{COMP_WORDS[COMP_CWORD - 2]}}
  for word in "${{COMP_WORDS[@]:1:COMP_CWORD - 1}}"; do
    [[ $word != -* ]] || continue
    command=$word
    break
  done
  case $command in
{1}  esac
  case $command:$previous in
{2}  esac
  COMPREPLY=()
  if [[ -n $values ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$values" -- "$current")
  elif [[ $current == -* ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$options" -- "$current")
  elif [[ -z $command ]]; then
    mapfile -t COMPREPLY < <(compgen -W '{3}' -- "$current")
  fi
}}
# Where it has nothing to offer, files are.
complete -o default -F _{0} {0}
)",
      program.get_name(), options, values, fmt::join(commands, " "));
}

}  // namespace curvisplat
