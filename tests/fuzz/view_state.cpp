// What the window remembers. What is read is written and read again as the same, and told as a command.
#include "tools/viewer/view_state.h"

#include "stream/error.h"
#include "tests/fuzz/fuzz_target.h"

namespace curvisplat {
namespace {

void run(std::span<const std::byte> bytes) {
  Manifest manifest;
  manifest.lower = {-1, 2, 3};
  manifest.upper = {3, 6, 7};
  manifest.variables = {{0, "density", "", 0, 1}, {1, "mach", "", 0.1, 2}};
  const ViewState state = viewStateFromJson(std::string(textOf(bytes)), "state.json", manifest);
  const std::string text = toJson(state);
  CURVISPLAT_CHECK(toJson(viewStateFromJson(text, "again.json", manifest)) == text);
  const std::string command = renderCommand(state, "a.splats", {600, 400}, "function.json");
  CURVISPLAT_CHECK(command.find('\n') == std::string::npos);
  state.function.function();
}

const RegisteredFuzzTarget registered("view_state", run);

}  // namespace
}  // namespace curvisplat
