// The page that the window shows before anything is open: how to open a file, an example, and what was opened before.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace curvisplat {

struct WelcomeChoice {
  bool opens = false, example = false;
  std::optional<size_t> recent;  // which of them
};

/// Draws it into the middle of the current Dear ImGui window. `recent`: files that were opened together, the newest first.
WelcomeChoice drawWelcomePage(const std::vector<std::vector<std::string>>& recent, bool has_example);

}  // namespace curvisplat
