#include "tools/options/manual_page.h"

#include <fmt/format.h>

#include <cctype>
#include <string_view>
#include <vector>

#include "tools/options/shown_options.h"

namespace curvisplat {
namespace {

/// As roff reads it: hyphens that can be copied, and nothing that begins a request.
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
std::string namesOf(const CLI::Option& option) {
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
  return fmt::format(".TP\n{}\n{}\n", namesOf(option), text);
}

}  // namespace

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

}  // namespace curvisplat
