// OpenGL and the processor draw the same picture of every scene.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "render/image/image.h"
#include "render/image/image_file.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

struct BackendScene {
  std::string scene;
  std::vector<std::string> options;  // of `generate`
};

void PrintTo(const BackendScene& scene, std::ostream* out) {
  *out << scene.scene;
  for (const std::string& option : scene.options) *out << ' ' << option;
}

class EveryScene : public testing::TestWithParam<BackendScene> {
 protected:
  std::string file(const std::string& name) const { return (folder_ / name).string(); }
  static void run(const std::vector<std::string>& arguments) {
    const ProgramResult result = runProgram(arguments);
    ASSERT_EQ(result.status, 0) << result.err;
  }
  Image render(const std::string& backend, const std::vector<std::string>& view,
               const std::string& function) {
    std::vector<std::string> arguments{"render", file("a.splats"), "-o",    file("a.pfm"), "--backend",
                                       backend,  "--size",         "96x96", "--tf",        function};
    arguments.insert(arguments.end(), view.begin(), view.end());
    run(arguments);
    return readImage(file("a.pfm"));
  }

  const TemporaryFolder folder_;
};

INSTANTIATE_TEST_SUITE_P(, EveryScene,
                         testing::Values(BackendScene{"half-annulus", {}},
                                         BackendScene{"half-annulus", {"--clustering", "9"}},
                                         BackendScene{"half-annulus-constant", {}}, BackendScene{"shell", {}},
                                         BackendScene{"o-grid", {}}, BackendScene{"axis", {}},
                                         BackendScene{"sheared-waves", {}}, BackendScene{"wake", {}}));

TEST_P(EveryScene, IsTheSameByOpenGlAndByTheProcessor) {
  std::vector<std::string> generate{"generate", GetParam().scene, "--size", "32x20x20", "-o", file("a")};
  generate.insert(generate.end(), GetParam().options.begin(), GetParam().options.end());
  run(generate);
  run({"convert", file("a.xyz"), file("a.fun"), "-o", file("a.splats")});
  if (HasFatalFailure()) return;
  const std::vector<std::vector<std::string>> views{
      {}, {"--view", "-z"}, {"--view", "+x"}, {"--view-angle", "60"}, {"--lod-pixels", "8"}};
  for (const auto& view : views)
    for (const std::string function : {"viridis", "cool-warm"}) {
      const ImageDifference difference =
          compareImages(render("osmesa", view, function), render("cpu", view, function));
      if (HasFatalFailure()) return;
      EXPECT_GE(difference.psnr_db, 50) << function << ' ' << testing::PrintToString(view);
    }
}

}  // namespace
}  // namespace curvisplat
