// OpenGL and the processor draw the same picture of every scene, and of what lies around the volume: surfaces,
// slices, isosurfaces, light, cuts and two scalars. There EGL is compared, too, where the machine has it, if only in
// software.
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "render/image/image.h"
#include "render/image/image_file.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/program_test.h"

namespace curvisplat {
namespace {

struct BackendScene {
  std::string scene;
  Words options;  // of `generate`

  friend void PrintTo(const BackendScene& scene, std::ostream* out) {
    *out << scene.scene;
    for (const std::string& option : scene.options) *out << ' ' << option;
  }
};

/// Returns what EGL draws with here, or why it does not.
std::string eglOf(const ProgramResult& system) {
  const auto report = nlohmann::json::parse(system.out);
  for (const auto& backend : report.at("backends"))
    if (backend.at("name") == "egl") return backend.at("found").get<std::string>();
  return {};
}

/// "card": EGL, with bricks that stay on the card.
Words optionsOf(const std::string& backend) {
  return backend == "card" ? Words{"--backend", "egl", "--card-memory", "64M"} : Words{"--backend", backend};
}

class EveryScene : public ProgramTest, public testing::WithParamInterface<BackendScene> {
 protected:
  Image render(const std::string& backend, const Words& view, const std::string& function) {
    return pictureOf(file("a.splats"), file("a.pfm"), optionsOf(backend) + Words{"--tf", function} + view);
  }
};

INSTANTIATE_TEST_SUITE_P(, EveryScene,
                         testing::Values(BackendScene{"half-annulus", {}},
                                         BackendScene{"half-annulus", {"--clustering", "9"}},
                                         BackendScene{"half-annulus-constant", {}}, BackendScene{"shell", {}},
                                         BackendScene{"o-grid", {}}, BackendScene{"axis", {}},
                                         BackendScene{"sheared-waves", {}}, BackendScene{"wake", {}},
                                         BackendScene{"ocean", {}}, BackendScene{"boundary-layer", {}}));

TEST_P(EveryScene, IsTheSameByOpenGlAndByTheProcessor) {
  run(Words{"generate", GetParam().scene, "--size", "24x14x12", "-o", file("a")} + GetParam().options);
  run({"convert", file("a.xyz"), file("a.fun"), "-o", file("a.splats")});
  const std::vector<Words> views{
      {}, {"--view", "-z"}, {"--view", "+x"}, {"--view-angle", "60"}, {"--lod-pixels", "8"}};
  static const bool has_tiles =
      eglOf(run({"info", "--system", "--json"})).find("compute shaders") != std::string::npos;
  // Usually one combination of each scene, each view and each function with some.
  static size_t combination = 0;
  for (const auto& view : views)
    for (const std::string function : {"viridis", "cool-warm"}) {
      if (!faults::isTried(combination++, 11)) continue;
      const Image cpu = render("cpu", view, function);
      const std::string what = function + ' ' + testing::PrintToString(view);
      EXPECT_GE(compareImages(render("osmesa", view, function), cpu).psnr_db, 50) << what;
      if (!has_tiles) continue;
      EXPECT_EQ(render("card", view, function).rgba, render("card", view, function).rgba) << what;
      if (view == views.back()) continue;
      // The card draws all layers of thin cells, as the processor does without tolerance.
      const Words whole = view + Words{"--lod-pixels", "0"};
      EXPECT_GE(compareImages(render("card", whole, function), render("cpu", whole, function)).psnr_db, 60)
          << what;
    }
}

const Words kAround[] = {
    {"--surface", "kmin,jmax"},
    {"--surface", "kmin,jmax", "--surface-opacity", "0.4"},
    {"--surface", "kmin,kmax", "--surface-by", "f", "--surface-opacity", "function"},
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

class DrawnWake : public ProgramTest {
 protected:
  Image drawn(const std::string& backend, const Words& view, const Words& more) const {
    Words words =
        optionsOf(backend) + Words{"--range", "0,1", "--view", "iso", "--background", "white"} + view;
    for (const std::string& option : more) words.push_back(option == "sheet.obj" ? file(option) : option);
    return pictureOf(file("wake.splats"), file("a.pfm"), words, "100x75");
  }
};

class AroundBackends : public DrawnWake, public testing::WithParamInterface<std::string> {
 protected:
  void SetUp() override {
    const ProgramResult system = run({"info", "--system", "--json"});
    const auto report = nlohmann::json::parse(system.out);
    for (const auto& backend : report.at("backends"))
      if (backend.at("name") == (GetParam() == "card" ? "egl" : GetParam()) &&
          !backend.at("works").get<bool>())
        GTEST_SKIP() << backend.dump();
    madeCache(file("wake"), "wake", "24x16x12", {"--scalar", "f,jacobian"});
    std::ofstream(file("sheet.obj")) << "v -3 -2 1\nv 6 -2 2.5\nv 6 2 3\nv -3 2 1.5\nf 1 2 3 4\n";
  }
};

INSTANTIATE_TEST_SUITE_P(, AroundBackends, testing::Values("osmesa", "egl", "card"),
                         [](const testing::TestParamInfo<std::string>& tested) { return tested.param; });

TEST_P(AroundBackends, DrawWhatTheProcessorDraws) {
  // Usually each option from one of the two views by one of the three: by OSMesa one in four, with EGL two in seven.
  size_t combination = GetParam() == "egl" ? 1 : GetParam() == "card" ? 3 : 0;
  for (const Words& view : {Words{}, Words{"--view-angle", "40"}}) {
    const Image plain = drawn("cpu", view, {});
    for (const Words& options : kAround) {
      if (!faults::isTried(combination++, GetParam() == "osmesa" ? 4 : 7)) continue;
      const Image cpu = drawn("cpu", view, options), image = drawn(GetParam(), view, options);
      EXPECT_LT(compareImages(cpu, plain).psnr_db, 60)  // a nearly transparent face: 57.5
          << "changes nothing: " << testing::PrintToString(options);
      EXPECT_GE(compareImages(image, cpu).psnr_db, 60) << testing::PrintToString(options);
    }
  }
}

TEST_F(DrawnWake, KeepsBricksOnTheCardAsItIsTold) {
  madeCache(file("wake"), "wake", "24x16x12", {"--scalar", "f"});
  const auto storedWith = [&](const Words& more) {
    pictureOf(file("wake.splats"), file("a.pfm"), Words{"--stats", file("s.json"), "--view", "iso"} + more,
              "40x30");
    return jsonOf(file("s.json")).at("frames").at(0).at("card_splats").get<uint64_t>();
  };
  EXPECT_EQ(storedWith({"--backend", "cpu", "--card-memory", "64M"}), 0u);
  if (eglOf(run({"info", "--system", "--json"})).find("compute shaders") != std::string::npos) {
    EXPECT_GT(storedWith({"--backend", "egl", "--card-memory", "64M"}), 0u);
    EXPECT_EQ(storedWith({"--backend", "egl", "--card-memory", "0"}), 0u);
  }
  expectRefused({"render", file("wake.splats"), "-o", file("b.png"), "--card-memory", "much"}, 2,
                {"--card-memory much: expected a size such as 512M"});
}

// Mesa can be told to have an older OpenGL.
TEST_F(DrawnWake, HasQuadsWhereThereAreNoComputeShaders) {
  const auto found_now = [] { return eglOf(run({"info", "--system", "--json"})); };
  const std::string before = found_now();
  if (before.find("Mesa") == std::string::npos && before.find("llvmpipe") == std::string::npos)
    GTEST_SKIP() << before;
  expectSays(before, "compute shaders");
  madeCache(file("wake"), "wake", "24x16x12", {"--scalar", "f"});
  const Image quads = drawn("egl-quads", {}, {});
  setenv("MESA_GL_VERSION_OVERRIDE", "3.3", 1);
  const std::string found = found_now();
  const Image instead = drawn("egl", {}, {});
  unsetenv("MESA_GL_VERSION_OVERRIDE");
  expectSays(found, "quads (compute shaders need OpenGL 4.3)");
  EXPECT_EQ(instead.rgba, quads.rgba);
}

}  // namespace
}  // namespace curvisplat
