// PLOT3D files of text.
#include "tests/fuzz/plot3d_input.h"

namespace curvisplat {
namespace {

const RegisteredFuzzTarget plot3d_ascii_target("plot3d_ascii", [](std::span<const std::byte> bytes) {
  readPlot3d(bytes, true);
});

}  // namespace
}  // namespace curvisplat
