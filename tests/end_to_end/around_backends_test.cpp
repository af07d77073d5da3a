// What lies around the volume is the same picture by every painter: surfaces, slices, isosurfaces, light, cuts and two
// scalars. EGL is compared where the machine has it, if only in software.
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "render/image/image.h"
#include "render/image/image_file.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

using Options = std::vector<std::string>;

const Options kAround[] = {
    {"--surface", "kmin,jmax"},
    {"--surface", "kmin,jmax", "--surface-opacity", "0.4"},
    {"--surface", "kmin", "--surface-by", "f", "--surface-opacity", "function"},
    {"--surface", "sheet.obj"},
    {"--slice=2,0,2,1,0.3,0.2", "--slice=2,0,2,0,0.4,1"},
    {"--slice=2,0,2,0.3,1,0.2", "--slice-opacity", "0.5"},
    {"--slice=2,0,2,0.3,1,0.2", "--volume", "off"},
    {"--iso", "0.5"},
    {"--iso", "0.3,0.6", "--iso-opacity", "0.5"},
    {"--shade"},
    {"--light-direction", "1,0.4,0.6", "--light", "0.2,0.8,0.4"},
    {"--clip-plane=2,0,2,1,0.3,0.2", "--clip-plane=2,0,2,0,-0.4,1"},
    {"--clip-box=-1,5,-1,1,1,3"},
    {"--surface", "kmin", "--clip-plane=2,0,2,1,0.3,0.2", "--shade"},
    {"--scalar", "jacobian", "--opacity-by", "f", "--opacity-range", "0,1"},
};

class AroundBackends : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    const ProgramResult system = runProgram({"info", "--system", "--json"});
    ASSERT_EQ(system.status, 0) << system.err;
    const auto report = nlohmann::json::parse(system.out);
    for (const auto& backend : report.at("backends"))
      if (backend.at("name") == GetParam() && !backend.at("works").get<bool>())
        GTEST_SKIP() << backend.dump();
    run({"generate", "wake", "--size", "48x32x24", "-o", file("wake")});
    run({"convert", file("wake.xyz"), file("wake.fun"), "-o", file("wake.splats"), "--scalar", "f,jacobian"});
    std::ofstream(file("sheet.obj")) << "v -3 -2 1\nv 6 -2 2.5\nv 6 2 3\nv -3 2 1.5\nf 1 2 3 4\n";
  }
  std::string file(const std::string& name) const { return (folder_ / name).string(); }
  static void run(const Options& arguments) {
    const ProgramResult result = runProgram(arguments);
    ASSERT_EQ(result.status, 0) << result.err;
  }
  Image drawn(const std::string& backend, const Options& view, const Options& more) const {
    Options arguments{"render", file("wake.splats"), "-o",      file("a.pfm"), "--backend", backend,
                      "--size", "160x120",           "--range", "0,1",         "--view",    "iso"};
    arguments.insert(arguments.end(), view.begin(), view.end());
    for (const std::string& option : more) arguments.push_back(option == "sheet.obj" ? file(option) : option);
    run(arguments);
    return readImage(file("a.pfm"));
  }

  const TemporaryFolder folder_;
};

INSTANTIATE_TEST_SUITE_P(, AroundBackends, testing::Values("osmesa", "egl"),
                         [](const testing::TestParamInfo<std::string>& tested) { return tested.param; });

TEST_P(AroundBackends, DrawWhatTheProcessorDraws) {
  for (const Options& view : {Options{}, Options{"--view-angle", "40"}}) {
    const Image plain = drawn("cpu", view, {});
    for (const Options& options : kAround) {
      const Image cpu = drawn("cpu", view, options), image = drawn(GetParam(), view, options);
      if (HasFatalFailure()) return;
      EXPECT_LT(compareImages(cpu, plain).psnr_db, 60)  // a nearly transparent face: 57.5
          << "changes nothing: " << testing::PrintToString(options);
      EXPECT_GE(compareImages(image, cpu).psnr_db, 50) << testing::PrintToString(options);
    }
  }
}

}  // namespace
}  // namespace curvisplat
