#include "tools/options/shown_options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

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

}  // namespace curvisplat
