// Legacy .vtk files, text and binary.
#include "tests/fuzz/vtk_input.h"

namespace curvisplat {
namespace {

const RegisteredFuzzTarget vtk_legacy_target("vtk_legacy", [](std::span<const std::byte> bytes) {
  readVtk("a.vtk", bytes);
});

}  // namespace
}  // namespace curvisplat
