// Caches of grids that were opened without `convert`, in a folder of the test's own.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/end_to_end/window_fixture.h"

namespace curvisplat {

class KeptCaches : public WindowTest {
 protected:
  void SetUp() override {
    setenv("XDG_CACHE_HOME", file("kept").c_str(), 1);
    unsetenv("CURVISPLAT_CACHE_SIZE");
    std::filesystem::remove_all("kept");
  }
  static std::vector<std::filesystem::path> kept() {
    std::vector<std::filesystem::path> caches;
    if (!std::filesystem::exists("kept/curvisplat")) return caches;
    for (const auto& entry : std::filesystem::recursive_directory_iterator("kept/curvisplat"))
      if (entry.path().filename() == "manifest.json") caches.push_back(entry.path().parent_path());
    return caches;
  }
  static ProgramResult render(const std::string& grid, const std::string& function) {
    return runProgram({"render", grid, function, "-o", "grid.png", "--size", "100x80"});
  }
};

}  // namespace curvisplat
