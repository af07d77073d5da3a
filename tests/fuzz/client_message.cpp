// What pages send to the server. The state of a view is read as the server reads it.
#include "tools/serve/client_message.h"

#include <string>
#include <variant>

#include "stream/base/check.h"
#include "tools/serve/access.h"
#include "tools/viewer/view_state.h"

#include "tests/fuzz/fuzz_target.h"

namespace curvisplat {
namespace {

Manifest manifest() {
  Manifest manifest;
  manifest.lower = {-1, 2, 3};
  manifest.upper = {3, 6, 7};
  manifest.variables = {{0, "density", "", 0, 1}, {1, "mach", "", 0.1, 2}};
  return manifest;
}

void fuzzClientMessage(std::span<const std::byte> bytes) {
  const std::string_view text = textOf(bytes);
  // The same bytes as the headers of a request: these refuse, and never throw.
  targetOf(text);
  isKnownHost(text, {"node7"});
  isOwnOrigin(text, text.substr(0, text.size() / 2));
  isSameToken(text, "0123456789abcdef");
  const ClientMessage message = parseClientMessage(text, 3);
  if (const auto* const open = std::get_if<OpenRequest>(&message)) CURVISPLAT_CHECK_OP(open->cache, <, 3u);
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
  state.frameOptions(view->size);
}

const RegisteredFuzzTarget client_message_target("client_message", fuzzClientMessage);

}  // namespace
}  // namespace curvisplat
