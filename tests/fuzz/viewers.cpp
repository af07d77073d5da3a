// Inputs of viewers: the state of a view that the window remembers, and what pages send to the server.
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <string>
#include <variant>

#include "stream/base/error.h"
#include "tests/fuzz/fuzz_target.h"
#include "tools/serve/client_requests.h"
#include "tools/view/saved_views.h"
#include "tools/view/view_state.h"

namespace curvisplat {
namespace {

Manifest manifest() {
  Manifest manifest;
  manifest.lower = {-1, 2, 3};
  manifest.upper = {3, 6, 7};
  manifest.variables = {{0, "density", "", 0, 1}, {1, "mach", "", 0.1, 2}};
  return manifest;
}

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

// The state that the window remembers. What is read is written and read again as the same, but for rounding,
// and told as a command.
void fuzzViewState(std::span<const std::byte> bytes) {
  const Manifest of = manifest();
  const ViewState state = viewStateFromJson(std::string(textOf(bytes)), "state.json", of);
  const std::string text = toJson(state);
  const std::string again = toJson(viewStateFromJson(text, "again.json", of));
  CURVISPLAT_CHECK(isSame(nlohmann::json::parse(again), nlohmann::json::parse(text)));
  const std::string command = renderCommand(state, {"a.splats", {600, 400}, "function.json", "opacity.json"});
  CURVISPLAT_CHECK(command.find('\n') == std::string::npos);
  state.function.function();
}

const RegisteredFuzzTarget view_state_target("view_state", fuzzViewState);

// Messages of pages to the server. The state of a view is read as the server reads it.
void fuzzClientMessage(std::span<const std::byte> bytes) {
  const std::string_view text = textOf(bytes);
  // The same bytes as the headers of a request: these refuse, and never throw.
  targetOf(text);
  isKnownHost(text, {"node7"});
  isOwnOrigin(text, text.substr(0, text.size() / 2));
  isSameToken(text, "0123456789abcdef");
  const ClientMessage message = parseClientMessage(text);
  if (const auto* const histogram = std::get_if<HistogramRequest>(&message)) {
    CURVISPLAT_CHECK_OP(histogram->low, <, histogram->high);
    CURVISPLAT_CHECK(!histogram->log || histogram->low > 0);
  }
  if (const auto* const pick = std::get_if<PickRequest>(&message)) {
    CURVISPLAT_CHECK(pick->x >= 0 && pick->x <= 1);
    CURVISPLAT_CHECK(pick->y >= 0 && pick->y <= 1);
  }
  const auto* const view = std::get_if<ViewRequest>(&message);
  if (!view) return;
  CURVISPLAT_CHECK_OP(view->size.width, <=, kLargestSide);
  CURVISPLAT_CHECK_OP(view->size.width, >, 0);
  const ViewState state = viewStateFromJson(view->state, "view", manifest());
  state.function.function();
  state.frameOptions(view->size, manifest());
}

const RegisteredFuzzTarget client_message_target("client_message", fuzzClientMessage);

}  // namespace
}  // namespace curvisplat
