// Pictures: PFM is read here; PNG and EXR by libraries, with checks of ours before them.
#include "render/image/image.h"
#include "render/image/image_file.h"
#include "stream/base/check.h"

#include "tests/fuzz/fuzz_target.h"

namespace curvisplat {
namespace {

void fuzzImage(std::span<const std::byte> bytes) {
  const Image image = readImage(fuzzFile("picture", bytes));
  CURVISPLAT_CHECK_OP(image.rgba.size(), ==, 4 * image.size.pixels());
}

const RegisteredFuzzTarget image_target("image", fuzzImage);

}  // namespace
}  // namespace curvisplat
