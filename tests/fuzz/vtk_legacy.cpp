// Legacy .vtk files, text and binary.
#include "tests/fuzz/vtk_input.h"

namespace curvisplat {
namespace {

const RegisteredFuzzTarget registered("vtk_legacy",
                                      [](std::span<const std::byte> bytes) { readVtk("a.vtk", bytes); });

}  // namespace
}  // namespace curvisplat
