#include "tools/options/scalar_arguments.h"

#include <fmt/format.h>

#include <utility>

#include "stream/base/error.h"
#include "tools/options/option_parsers.h"

namespace curvisplat {

void addScalarOption(CLI::App& command, ScalarArguments& words) {
  command.add_option("--scalar", words.scalar, "Name of the scalar; the cache's first otherwise");
}

void addFunctionOptions(CLI::App& command, ScalarArguments& words, const std::string& group) {
  command
      .add_option("--tf", words.transfer_function,
                  fmt::format("Transfer function: {}, or a ParaView preset FILE.json", presetNames()))
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--range", words.range,
                  "LO,HI: stretch it over these scalars; the scalar's own range otherwise (a file: as it is)")
      ->group(group);
  command
      .add_option("--opacity-unit", words.opacity_unit,
                  "Length, in world units, that opacities are for; 1/100 of the data's diagonal otherwise")
      ->group(group);
}

size_t chooseVariable(const CacheReader& cache, const ScalarArguments& words) {
  try {
    return cache.variableNamed(words.scalar);
  } catch (const UsageError& error) {
    throw Error("{}", error.what());
  }
}

TransferFunction chooseTransferFunction(const ScalarArguments& words, const VariableInfo& variable,
                                        double diagonal) {
  const double default_unit = diagonal > 0 ? diagonal / 100 : 1;
  const double unit = words.opacity_unit ? parsePositive("--opacity-unit", *words.opacity_unit) : 0;
  std::optional<std::pair<double, double>> range;
  if (words.range) {
    const auto ends = parseNumbers("--range", *words.range, "LO,HI");
    if (!(ends[0] < ends[1])) throw UsageError("--range {}: expected LO,HI with LO < HI", *words.range);
    range.emplace(ends[0], ends[1]);
  }
  if (words.transfer_function.ends_with(".json"))
    return TransferFunction::fromFile(words.transfer_function, range ? &*range : nullptr, unit, default_unit);
  return TransferFunction::preset(words.transfer_function, range ? range->first : variable.min,
                                  range ? range->second : variable.max, unit > 0 ? unit : default_unit);
}

}  // namespace curvisplat
