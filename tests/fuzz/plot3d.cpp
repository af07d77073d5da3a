// Binary PLOT3D files, whose layout is found out from what is in them.
#include "tests/fuzz/plot3d_input.h"

namespace curvisplat {
namespace {

const RegisteredFuzzTarget plot3d_target("plot3d",
                                         [](std::span<const std::byte> bytes) { readPlot3d(bytes, false); });

}  // namespace
}  // namespace curvisplat
