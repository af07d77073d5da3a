// .vts, .vtr and .vti files in all encodings.
#include "tests/fuzz/vtk_input.h"

namespace curvisplat {
namespace {

const RegisteredFuzzTarget vtk_xml_target("vtk_xml",
                                          [](std::span<const std::byte> bytes) { readVtk("a.vts", bytes); });

}  // namespace
}  // namespace curvisplat
