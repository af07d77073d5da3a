// The window without a file: its start page, an example, and grids that are folders in its dialog.
#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <numeric>
#include <string>
#include <vector>

#include "tests/end_to_end/window_fixture.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

class WindowStart : public KeptCaches {
 protected:
  void SetUp() override {
    WindowTest::SetUp();
    if (IsSkipped()) return;
    KeptCaches::SetUp();
    fs::remove_all("kept");
  }
  void openEmpty() {
    fs::remove("widgets");
    window_ = std::make_unique<RunningProgram>(
        Words{"view", "--size", fmt::format("{}x{}", kWindow.width, kWindow.height)});
    rest_ = {kWindow.width / 2, kWindow.height / 2};
    moveTo(rest_);
  }
};

/// A grid of 6 x 6 x 6 nodes in a store of Zarr 2.
void writeZarr(const fs::path& store) {
  const auto array = [&](const std::string& name, const std::string& shape, const std::string& dimensions,
                         const std::string& chunk, const std::vector<float>& values) {
    fs::create_directories(store / name);
    std::ofstream(store / name / ".zarray")
        << R"({"zarr_format": 2, "dtype": "<f4", "compressor": null, "fill_value": 0, "order": "C", )"
        << fmt::format(R"("filters": null, "shape": {0}, "chunks": {0}}})", shape);
    std::ofstream(store / name / ".zattrs") << fmt::format(R"({{"_ARRAY_DIMENSIONS": {}}})", dimensions);
    std::ofstream(store / name / chunk, std::ios::binary)
        .write(reinterpret_cast<const char*>(values.data()),
               static_cast<std::streamsize>(values.size() * sizeof(float)));
  };
  for (const char* axis : {"x", "y", "z"})
    array(axis, "[6]", fmt::format(R"(["{}"])", axis), "0", {0, 1, 2, 3, 4, 5});
  std::vector<float> values(6 * 6 * 6);
  std::iota(values.begin(), values.end(), 0.0f);
  array("f", "[6, 6, 6]", R"(["z", "y", "x"])", "0.0.0", values);
  std::ofstream(store / ".zgroup") << R"({"zarr_format": 2})";
}

/// The folder is a grid, and is not entered.
TEST_F(WindowStart, TheDialogOpensAZarrStore) {
  writeZarr("box.zarr");
  openEmpty();
  click("open");
  const Place place = placeOf("file box.zarr");
  moveTo(place);
  EXPECT_TRUE(eventually([&] {  // where frames are slow, the window may not hear of both clicks in time
    act({"click", "--repeat", "2", "1"});
    return eventually([] { return !hasWidget("file name"); }, 5);
  }));
  placeOf("scalar shown: f");
  close();
}

/// The grid alone is not enough: the dialog says so, with the grid still chosen. With its solution what was said goes away. The folder is
/// that of the next grid's dialog, also in the next window, and not of pictures.
TEST_F(WindowStart, ALoneGridAsksForItsSolution) {
  fs::remove_all("both");
  fs::create_directory("both");
  for (const char* name : {"a.xyz", "a.fun", "a.nam"}) fs::copy_file(name, fs::path("both") / name);
  openEmpty();
  click("open");
  placeOf("file name");
  act({"type", "both/a.xyz"});
  press("Return");
  const auto says = [] { return hasWidget("message a.xyz: has no values"); };
  EXPECT_TRUE(eventually([] { return hasWidget("file error a.xyz: has no values"); }));
  EXPECT_TRUE(says());
  moveTo(placeOf("file a.fun"));
  act({"keydown", "ctrl", "click", "1", "keyup", "ctrl"});
  click("file accept");
  EXPECT_TRUE(eventually([] { return hasWidget("scalar shown: f"); }, 60));
  EXPECT_TRUE(eventually([&] { return !says(); }));
  click("Save picture as...");
  placeOf("file both");
  press("Escape");
  EXPECT_TRUE(eventually([] { return !hasWidget("file name"); }));
  close();
  openEmpty();
  click("open");
  placeOf("file a.fun");
  EXPECT_FALSE(hasWidget("file both"));
  press("Escape");
  EXPECT_TRUE(eventually([] { return !hasWidget("file name"); }));
  close();
}

TEST_F(WindowStart, AnExampleIsShownWithoutAFile) {
  openEmpty();
  click("example");
  placeOf("step 1 of 8");
  ASSERT_TRUE(eventually([] { return !hasWidget("opening"); }, 300));
  placeOf("curve");
  close();
  // Among what was opened before, also where its files have been removed.
  fs::remove_all("kept");
  openEmpty();
  click("recent 1");
  placeOf("step 1 of 8");
  close();
}

}  // namespace
}  // namespace curvisplat
