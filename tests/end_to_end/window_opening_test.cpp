// Grids that are opened without a conversion by hand: converted into the user's cache folder, by `view` and `render`.
#include <fmt/format.h>

#include <chrono>
#include <thread>

#include "tests/end_to_end/window_fixture.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

class KeptCaches : public WindowTest {
 protected:
  void SetUp() override {
    setenv("XDG_CACHE_HOME", file("kept").c_str(), 1);
    unsetenv("CURVISPLAT_CACHE_SIZE");
    fs::remove_all("kept");
  }
  static std::vector<fs::path> kept() {
    std::vector<fs::path> caches;
    if (!fs::exists("kept/curvisplat")) return caches;
    for (const auto& entry : fs::recursive_directory_iterator("kept/curvisplat"))
      if (entry.path().filename() == "manifest.json") caches.push_back(entry.path().parent_path());
    return caches;
  }
  static ProgramResult render(const std::string& grid, const std::string& function) {
    return runProgram({"render", grid, function, "-o", "grid.png", "--size", "100x80"});
  }
};

TEST_F(KeptCaches, RenderDrawsAGridAsItsCache) {
  ASSERT_EQ(render("a.xyz", "a.fun").status, 0);
  ASSERT_EQ(kept().size(), 1u);
  EXPECT_EQ(kept()[0].filename(), "a.splats");
  const Image drawn = readImage("grid.png");
  run({"convert", "a.xyz", "a.fun", "-o", "whole.splats", "--overwrite"});
  run({"render", "whole.splats", "-o", "whole.png", "--size", "100x80"});
  EXPECT_EQ(readImage("whole.png").rgba, drawn.rgba);
}

TEST_F(KeptCaches, AreFoundAgainByContent) {
  ASSERT_EQ(render("a.xyz", "a.fun").status, 0);
  const auto made = fs::last_write_time(kept().at(0) / "manifest.json");
  ASSERT_EQ(render("a.xyz", "a.fun").status, 0);
  // The same bytes elsewhere, written later.
  fs::create_directory("elsewhere");
  for (const char* name : {"a.xyz", "a.fun"})
    fs::copy_file(name, fs::path("elsewhere") / name, fs::copy_options::overwrite_existing);
  ASSERT_EQ(render("elsewhere/a.xyz", "elsewhere/a.fun").status, 0);
  ASSERT_EQ(kept().size(), 1u);
  EXPECT_EQ(fs::last_write_time(kept()[0] / "manifest.json"), made);
  // Other bytes are another cache, at the same path.
  run({"generate", "half-annulus", "--size", "24x12x12", "-o", "elsewhere/a"});
  ASSERT_EQ(render("elsewhere/a.xyz", "elsewhere/a.fun").status, 0);
  EXPECT_EQ(kept().size(), 2u);
}

TEST_F(KeptCaches, TheLeastRecentlyUsedGoFirst) {
  for (const char* name : {"b", "c"})
    run({"generate", "half-annulus", "--size", *name == 'b' ? "24x12x12" : "20x12x12", "-o", name});
  ASSERT_EQ(render("a.xyz", "a.fun").status, 0);
  ASSERT_EQ(render("b.xyz", "b.fun").status, 0);
  ASSERT_EQ(render("a.xyz", "a.fun").status, 0);  // used again
  uint64_t bytes = 0;
  for (const fs::path& cache : kept())
    for (const auto& entry : fs::recursive_directory_iterator(cache)) bytes += entry.file_size();
  setenv("CURVISPLAT_CACHE_SIZE", std::to_string(bytes).c_str(), 1);
  ASSERT_EQ(render("c.xyz", "c.fun").status, 0);
  std::vector<std::string> names;
  for (const fs::path& cache : kept()) names.push_back(cache.filename());
  std::sort(names.begin(), names.end());
  EXPECT_EQ(names, (std::vector<std::string>{"a.splats", "c.splats"}));
}

TEST_F(KeptCaches, ErrorsNameTheFile) {
  std::ofstream("no.xyz") << "no grid";
  const ProgramResult result = render("no.xyz", "a.fun");
  EXPECT_EQ(result.status, 1);
  EXPECT_NE(result.err.find("no.xyz"), std::string::npos) << result.err;
  EXPECT_TRUE(kept().empty());
}

class WindowOpening : public KeptCaches {
 protected:
  void SetUp() override {
    WindowTest::SetUp();
    if (IsSkipped()) return;
    KeptCaches::SetUp();
  }
  void openWith(const std::vector<std::string>& files) {
    std::vector<std::string> words{"view"};
    words.insert(words.end(), files.begin(), files.end());
    words.insert(words.end(), {"--size", fmt::format("{}x{}", kWindow.width, kWindow.height)});
    fs::remove("widgets");
    window_ = std::make_unique<RunningProgram>(words);
    rest_ = {kWindow.width / 2, kWindow.height / 2};
    moveTo(rest_);
  }
};

TEST_F(WindowOpening, ViewOpensAGrid) {
  openWith({"a.xyz", "a.fun"});
  placeOf("curve");  // the panels of the cache
  EXPECT_EQ(kept().size(), 1u);
  const Image picture = saveAndCopy();
  const auto command = close().at(0);
  expectDraws(command, picture);
}

TEST_F(WindowOpening, WithoutAFileItAsksForOneAndRemembersIt) {
  openWith({});
  click("open");
  placeOf("file name");
  act({"type", "a.xyz a.fun"});
  press("Return");
  placeOf("curve");
  close();
  openWith({});
  click("recent 1");
  placeOf("curve");
  close();
}

TEST_F(WindowOpening, AnswersWhileItConverts) {
  run({"generate", "half-annulus", "--size", "256x160x160", "-o", "large"});
  openWith({"large.xyz", "large.fun"});
  placeOf("stop opening");
  press("F1");
  placeOf("window Keys and mouse");
  EXPECT_TRUE(hasWidget("stop opening"));  // it goes on
  click("stop opening");
  EXPECT_TRUE(eventually([] { return !hasWidget("stop opening"); }));
  EXPECT_FALSE(hasWidget("curve"));  // nothing was opened
  close();
}

TEST_F(WindowOpening, WhatCannotBeOpenedIsSaidAndTheWindowLives) {
  std::ofstream("no.xyz") << "no grid";
  openWith({"no.xyz", "a.fun"});
  EXPECT_TRUE(eventually([] { return hasWidget("message "); }));
  placeOf("open");
  close();
}

}  // namespace
}  // namespace curvisplat
