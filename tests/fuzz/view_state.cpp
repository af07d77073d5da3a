// What the window remembers. What is read is written and read again as the same, but for rounding, and told
// as a command.
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "stream/base/check.h"
#include "tools/viewer/render_command.h"
#include "tools/viewer/view_state.h"

#include "tests/fuzz/fuzz_target.h"

namespace curvisplat {
namespace {

/// The points of a function are kept as parts of its range, and written as scalars.
bool isSame(const nlohmann::json& a, const nlohmann::json& b) {
  if (a.is_structured())
    return a.type() == b.type() && a.size() == b.size() &&
           std::equal(a.begin(), a.end(), b.begin(),
                      [](const auto& one, const auto& other) { return isSame(one, other); });
  if (!a.is_number_float() || !b.is_number_float()) return a == b;
  const double x = a, y = b;
  return std::abs(x - y) <= 1e-9 * std::max({1.0, std::abs(x), std::abs(y)});
}

void fuzzViewState(std::span<const std::byte> bytes) {
  Manifest manifest;
  manifest.lower = {-1, 2, 3};
  manifest.upper = {3, 6, 7};
  manifest.variables = {{0, "density", "", 0, 1}, {1, "mach", "", 0.1, 2}};
  const ViewState state = viewStateFromJson(std::string(textOf(bytes)), "state.json", manifest);
  const std::string text = toJson(state);
  const std::string again = toJson(viewStateFromJson(text, "again.json", manifest));
  CURVISPLAT_CHECK(isSame(nlohmann::json::parse(again), nlohmann::json::parse(text)));
  const std::string command = renderCommand(state, {"a.splats", {600, 400}, "function.json", "opacity.json"});
  CURVISPLAT_CHECK(command.find('\n') == std::string::npos);
  state.function.function();
}

const RegisteredFuzzTarget view_state_target("view_state", fuzzViewState);

}  // namespace
}  // namespace curvisplat
