// manifest.json. What is read is written and read again as the same.
#include "stream/cache/manifest.h"
#include "stream/base/check.h"

#include "tests/fuzz/fuzz_target.h"

namespace curvisplat {
namespace {

void fuzzManifest(std::span<const std::byte> bytes) {
  const Manifest manifest = Manifest::fromJson(std::string(textOf(bytes)), "manifest.json");
  const std::string text = manifest.toJson();
  const std::string again = Manifest::fromJson(text, "again.json").toJson();
  CURVISPLAT_CHECK(text == again);
}

const RegisteredFuzzTarget manifest_target("manifest", fuzzManifest);

}  // namespace
}  // namespace curvisplat
