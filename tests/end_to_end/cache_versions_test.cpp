// Caches of the versions that have been, as they were written then: each is opened, checked, decoded and
// drawn, and gives what it gave. tests/programs/make_version_caches.cpp has made them.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "render/image/image_file.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/cache/cache_verify.h"
#include "stream/cache/faces_file.h"
#include "tests/support/cache_summary.h"
#include "tests/support/program_test.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

class CacheVersion : public ::testing::TestWithParam<const char*> {
 protected:
  static fs::path folder() { return fs::path(CURVISPLAT_TEST_DATA) / "caches" / GetParam(); }
};

INSTANTIATE_TEST_SUITE_P(Versions, CacheVersion, ::testing::Values("version_1", "version_2"),
                         [](const auto& tested) { return tested.param; });

/// `base`: what the names of the files beside the cache begin with, which say what is in it.
void expectContents(const CacheReader& cache, const std::string& base) {
  SCOPED_TRACE(base);
  EXPECT_TRUE(verifyCache(cache).findings.empty());

  const auto expected = jsonOf(base + ".json");
  const auto found = summaryOf(cache);
  EXPECT_EQ(found.size(), expected.size());
  for (const auto& [what, sum] : found) {
    ASSERT_TRUE(expected.contains(what)) << what;
    const double wanted = expected[what].get<double>();
    EXPECT_NEAR(sum, wanted, 1e-6 * std::abs(wanted) + 1e-9) << what;
  }

  const TemporaryFolder drawn;
  for (size_t variable = 0; variable < cache.manifest().variables.size(); ++variable) {
    const fs::path picture = drawn / "a.png";
    writeImage(smallPictureOf(cache, variable), picture);
    const Image kept = readImage(fmt::format("{}.{}.png", base, variable));
    // The kept pictures are from before tiles had their own order, and border cells their own scalar.
    EXPECT_GE(compareImages(readImage(picture), kept).psnr_db, 50) << variable;
  }
}

TEST_P(CacheVersion, IsStillRead) {
  std::vector<std::string> names{"blocks", "cells"};
  if (GetParam() != std::string("version_1"))
    names.insert(names.end(), {"faces", "octants", "own_blanks", "set_steps", "steep"});
  for (const std::string& name : names) {
    const std::string base = (folder() / name).string();
    CacheReader cache(base + ".splats");
    if (name == "set_steps") cache = cache.atStep(1);
    expectContents(cache, base);
    for (size_t n = 0; n < cache.seriesManifest().own_blanks.size(); ++n)
      expectContents(cache.ownBlanks(n), fmt::format("{}.blanks.{}", base, n + 1));
  }
  EXPECT_GT(CacheReader(folder() / "blocks.splats").manifest().levels, 1u);
  EXPECT_TRUE(CacheReader(folder() / "cells.splats").manifest().cells);
}

TEST(CacheVersions, ScalarsWithOwnBlanksAreFoundByName) {
  const fs::path folder = fs::path(CURVISPLAT_TEST_DATA) / "caches/version_2/own_blanks.splats";
  const CacheReader cache(folder);
  EXPECT_EQ(cache.allScalars(), (std::vector<std::string>{"s1", "s3", "s0", "s2"}));
  EXPECT_EQ(CacheReader::ofScalar(folder, "s3").cachePath(), folder);
  const CacheReader other = CacheReader::ofScalar(folder, "s2 [K]");
  EXPECT_EQ(other.cachePath(), folder / "blanks.2");
  EXPECT_EQ(other.allScalars(), std::vector<std::string>{"s2"});
  for (const CacheReader* const reader : {&cache, &other}) {
    EXPECT_EQ(reader->wholePath(), folder);
    EXPECT_EQ(reader->atStep(0).wholePath(), folder);
  }
  try {
    cache.variableNamed("s2");
    ADD_FAILURE();
  } catch (const UsageError& error) {
    EXPECT_NE(std::string(error.what()).find("s2 has values at other samples than s1, s3"), std::string::npos)
        << error.what();
  }
}

TEST(CacheVersions, FacesAreStillRead) {
  const fs::path folder = fs::path(CURVISPLAT_TEST_DATA) / "caches/version_2/faces.splats";
  const CacheReader cache(folder);
  const auto faces = FacesReader::open(cache.path(), cache.manifest());
  ASSERT_TRUE(faces);
  EXPECT_EQ(faces->faces().size(), 6u);
  EXPECT_EQ(faces->patches().size(), 14u);
  // A tube of radius 1 to 1.5: its inner wall, as it was written.
  for (uint32_t n = 0; n < faces->patches().size(); ++n) {
    const GridFace& face = faces->faces()[faces->patches()[n].face];
    if (face.axis != 1) continue;
    const double radius = face.side == FaceSide::kMin ? 1 : 1.5;
    for (const glm::dvec3& at : faces->read(n).positions) EXPECT_NEAR(std::hypot(at.x, at.y), radius, 1e-6);
  }
}

TEST(CacheVersions, UnknownVersionsAreRefusedWithAdvice) {
  const TemporaryFolder folder;
  const fs::path cache = folder / "a.splats";
  fs::copy(fs::path(CURVISPLAT_TEST_DATA) / "caches/version_1/cells.splats", cache);
  const std::pair<int, const char*> versions[] = {{0, "convert again"}, {3, "newer program"}};
  for (const auto& [version, what_to_do] : versions) {
    auto manifest = nlohmann::ordered_json::parse(readTextFile(cache / "manifest.json"));
    manifest["version"] = version;
    writeFileAtomically(cache / "manifest.json", manifest.dump());
    const std::string picture = folder / "a.png";
    for (const std::vector<std::string>& command :
         {std::vector<std::string>{"info", cache}, {"render", cache, "-o", picture}}) {
      expectRefused(command, 1, {fmt::format("version {}", version), what_to_do});
    }
    // Does what the message says.
    const std::string grid = folder / "grid";
    run({"generate", "wake", "--size", "8x8x8", "-o", grid});
    const std::vector<std::string> convert{"convert", grid + ".xyz", grid + ".fun", "-o", cache};
    EXPECT_EQ(runProgram(convert).status, 1);
    std::vector<std::string> overwrite = convert;
    overwrite.push_back("--overwrite");
    run(overwrite);
    run({"info", cache});
  }
}

TEST(CacheVersions, UnknownFeaturesAreRefused) {
  const TemporaryFolder folder;
  const fs::path cache = folder / "a.splats";
  fs::copy(fs::path(CURVISPLAT_TEST_DATA) / "caches/version_2/cells.splats", cache);
  run({"info", cache});
  auto manifest = nlohmann::ordered_json::parse(readTextFile(cache / "manifest.json"));
  manifest.erase("checksum");
  manifest["requires"].push_back("colours");
  writeFileAtomically(cache / "manifest.json", manifest.dump());
  expectRefused({"info", cache}, 1, {"'colours'", "newer program"});
}

}  // namespace
}  // namespace curvisplat
