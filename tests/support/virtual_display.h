// A display without a screen, and the hands and eyes of who sits before it: Xvfb, xdotool.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "render/image/image.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {

class VirtualDisplay {
 public:
  /// The programs that it needs and that are not installed; empty if all are.
  static std::string missing();

  /// Starts it, and sets DISPLAY for programs to come; the destructor ends it. `options` of Xvfb, beside
  /// ours.
  explicit VirtualDisplay(ImageSize size, const std::vector<std::string>& options = {});
  ~VirtualDisplay();

  /// xdotool's words: {"mousemove", "10", "20"}, {"key", "p"}. Throws where it fails.
  void act(const std::vector<std::string>& words) const;
  /// A picture of the screen.
  Image screenshot() const;

 private:
  const TemporaryFolder folder_;  // of the file that holds the screen's pixels
  std::string name_;              // ":1234"
  std::unique_ptr<RunningProgram> server_;
};

/// Asks again and again until `holds` or `seconds` have passed; whether it held.
[[nodiscard]] bool eventually(const std::function<bool()>& holds, double seconds = 60);

}  // namespace curvisplat
