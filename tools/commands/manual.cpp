// `curvisplat manual`: writes manual pages (man 1) and completion for bash, from the same table of options
// as --help. The build calls it and installs the files; --help does not list it.
#include "tools/commands/manual.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>

#include <cctype>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "stream/base/durable_file.h"
#include "tools/commands/commands.h"

namespace curvisplat {

std::vector<const CLI::App*> shownCommands(const CLI::App& program) {
  return program.get_subcommands([](const CLI::App* command) { return !command->get_group().empty(); });
}

std::vector<std::string> choicesOf(const CLI::Option& option) {
  // CLI::IsMember writes them so: "TEXT:{big,little}".
  const std::string type = option.get_type_name();
  const size_t begin = type.find('{'), end = type.rfind('}');
  if (begin == std::string::npos || end == std::string::npos) return {};
  return CLI::detail::split(type.substr(begin + 1, end - begin - 1), ',');
}

std::string valueName(const CLI::Option& option) {
  if (option.get_expected_max() == 0) return "";
  const std::vector<std::string> choices = choicesOf(option);
  if (!choices.empty()) return fmt::format("{}", fmt::join(choices, "|"));
  const std::string type = option.get_type_name();
  const bool is_number = type.starts_with("FLOAT") || type.starts_with("UINT") || type.starts_with("INT");
  std::string name = is_number ? "NUMBER" : "VALUE";
  if (option.get_type_size() > 1) name = fmt::format("{} x {}", name, option.get_type_size());
  return option.get_expected_max() > 1 ? name + " ..." : name;
}

namespace {

/// The text as roff reads it: hyphens that can be copied, and nothing that begins a request.
std::string roff(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '\\')
      out += "\\e";
    else if (c == '-')
      out += "\\-";
    else if ((c == '.' || c == '\'') && (out.empty() || out.back() == '\n'))
      out += std::string("\\&") + c;
    else
      out += c;
  }
  return out;
}

std::string bold(std::string_view text) {
  return "\\fB" + roff(text) + "\\fR";
}

std::string italic(std::string_view text) {
  return "\\fI" + roff(text) + "\\fR";
}

std::string upper(std::string text) {
  for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return text;
}

std::string head(const std::string& title, const std::string& name, const std::string& what) {
  return fmt::format(".TH {} 1 \"\" \"curvisplat {}\" \"curvisplat manual\"\n.SH NAME\n{} \\- {}\n",
                     roff(upper(title)), CURVISPLAT_VERSION, roff(name), roff(what));
}

/// "-o, --output VALUE"
std::string optionNames(const CLI::Option& option) {
  std::string names;
  for (const std::string& name : option.get_snames()) names += ", " + bold("-" + name);
  for (const std::string& name : option.get_lnames()) names += ", " + bold("--" + name);
  names = names.empty() ? italic(option.get_single_name()) : names.substr(2);
  const std::string value = valueName(option);
  return value.empty() || !option.nonpositional() ? names : names + " " + italic(value);
}

std::string entryOf(const CLI::Option& option) {
  std::string text = roff(option.get_description());
  if (!option.get_default_str().empty())
    text += fmt::format(" (default: {})", roff(option.get_default_str()));
  if (option.nonpositional() && option.get_required()) text += " (required)";
  return fmt::format(".TP\n{}\n{}\n", optionNames(option), text);
}

/// The page of the whole program, which names the subcommands. Subcommands without a group are hidden.
std::string programManual(const CLI::App& program) {
  std::string page = head("curvisplat", "curvisplat", "draw curvilinear grids that are larger than memory");
  page +=
      ".SH SYNOPSIS\n" + bold("curvisplat") + " " + italic("COMMAND") + " [" + italic("OPTION") + " ...]\n";
  page += ".SH DESCRIPTION\n" + roff(program.get_description()) +
          "\nA structured, curvilinear grid is converted once to a splat cache, a folder; pictures are drawn "
          "from "
          "it.\n";
  page += ".SH COMMANDS\n";
  for (const CLI::App* command : shownCommands(program))
    page += fmt::format(".TP\n\\fBcurvisplat\\-{}\\fR(1)\n{}\n", roff(command->get_name()),
                        roff(command->get_description()));
  page += ".SH OPTIONS\n";
  for (const CLI::Option* option : program.get_options()) page += entryOf(*option);
  page +=
      ".SH EXIT STATUS\n"
      ".TP\n0\nThe work is done.\n"
      ".TP\n1\nIt failed: a file, a disk or memory; one line on standard error says why.\n"
      ".TP\n2\nThe command line asks for something that does not exist or does not fit together.\n"
      ".TP\n128+n\nSignal n ended it.\n";
  page +=
      ".SH FILES\n.TP\n\\fI~/.config/curvisplat/\\fR\n"
      "What \\fBcurvisplat\\-view\\fR(1) remembers of each cache (in $XDG_CONFIG_HOME, if that is set).\n";
  return page;
}

/// The page of one subcommand.
std::string commandManual(const CLI::App& program, const CLI::App& command) {
  const std::string name = program.get_name() + "-" + command.get_name();
  std::string page = head(name, name, command.get_description());
  page += ".SH SYNOPSIS\n" + bold(program.get_name() + " " + command.get_name()) + " [" + italic("OPTION") +
          " ...]";
  std::vector<const CLI::Option*> arguments;
  for (const CLI::Option* option : command.get_options())
    if (option->get_positional()) arguments.push_back(option);
  for (const CLI::Option* argument : arguments) {
    const std::string many = argument->get_expected_max() > 1 ? " ..." : "";
    const std::string text = italic(argument->get_single_name()) + many;
    page += argument->get_required() ? " " + text : " [" + text + "]";
  }
  page += "\n.SH DESCRIPTION\n" + roff(command.get_description()) + ".\n";
  if (!arguments.empty()) page += ".SH ARGUMENTS\n";
  for (const CLI::Option* argument : arguments) page += entryOf(*argument);
  for (const std::string& group : command.get_groups()) {
    std::string entries;
    for (const CLI::Option* option : command.get_options())
      if (!option->get_positional() && option->get_group() == group) entries += entryOf(*option);
    if (entries.empty() || group.empty()) continue;
    page += (group == "Options" ? ".SH OPTIONS\n" : fmt::format(".SS \"{}\"\n", roff(group))) + entries;
  }
  page += ".SH SEE ALSO\n\\fBcurvisplat\\fR(1)";
  for (const CLI::App* other : shownCommands(program))
    if (other != &command) page += fmt::format(", \\fBcurvisplat\\-{}\\fR(1)", roff(other->get_name()));
  return page + "\n";
}

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

/// A script for bash-completion's folder, or to be sourced. It completes subcommands, options, the values of
/// options that have only some, and files elsewhere.
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

}  // namespace

void addManual(CLI::App& app) {
  auto folder = std::make_shared<std::filesystem::path>();
  CLI::App* command = app.add_subcommand("manual", "Write manual pages and bash completion into a folder");
  command->group("");
  command->add_option("FOLDER", *folder, "An existing folder")->required()->check(CLI::ExistingDirectory);
  command->callback([folder, &app] {
    writeFileDurably(*folder / "curvisplat.1", programManual(app));
    for (const CLI::App* shown : shownCommands(app))
      writeFileDurably(*folder / ("curvisplat-" + shown->get_name() + ".1"), commandManual(app, *shown));
    writeFileDurably(*folder / "curvisplat.bash", bashCompletion(app));
  });
}

}  // namespace curvisplat
