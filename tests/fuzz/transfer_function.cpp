// ParaView's colour maps. What is read is written and read again as the same, and gives colours and
// extinctions everywhere.
#include "render/colour/transfer_function.h"
#include "stream/base/check.h"

#include <cmath>

#include "render/colour/classification.h"
#include "tests/fuzz/fuzz_target.h"

namespace curvisplat {
namespace {

void checkValues(const TransferFunction& function) {
  const auto [low, high] = function.range();
  for (const double scalar :
       {low, 0.5 * low + 0.5 * high, 0.99 * high + 0.01 * low, high, -1e30, 0.0, 1e30}) {
    const TransferFunction::Value value = function.at(scalar);
    CURVISPLAT_CHECK(value.extinction >= 0 && std::isfinite(value.extinction));
    for (int c = 0; c < 3; ++c) CURVISPLAT_CHECK(value.colour[c] >= -1e-6 && value.colour[c] <= 1 + 1e-6);
  }
}

void fuzzTransferFunction(std::span<const std::byte> bytes) {
  const TransferFunctionDefinition definition = parseParaViewPreset(std::string(textOf(bytes)), "a.json");
  const std::string text = toParaViewPreset(definition);
  CURVISPLAT_CHECK(toParaViewPreset(parseParaViewPreset(text, "again.json")) == text);
  const std::pair<double, double> range(0.5, 2);
  checkValues(TransferFunction(definition, &range, 0.1));
  const TransferFunction as_it_is(definition, nullptr, 0.1);
  checkValues(as_it_is);
  if (bytes.size() % 16 == 0) {  // which takes long
    const ClassificationTable table = ClassificationTable::of(as_it_is, -1, 2);
    for (const double centre : {-1.0, 0.3, 5.0})
      for (int c = 0; c < 4; ++c) CURVISPLAT_CHECK(std::isfinite(table.mean(centre, 0.1)[c]));
  }
}

const RegisteredFuzzTarget transfer_function_target("transfer_function", fuzzTransferFunction);

}  // namespace
}  // namespace curvisplat
