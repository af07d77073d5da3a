// The signs of jobs in the background: what is done, how far it is, and a button that stops it.
#pragma once

#include <string>

#include "tools/viewer/background_job.h"
#include "tools/viewer/window.h"

namespace curvisplat {

/// In the corner of the picture, where it hides nothing that is looked at.
class JobDisplay {
 public:
  JobDisplay(const Rectangle& picture, Window& window) : picture_(picture), window_(window) {}

  /// Draws the next one below those before. `name` is that of its widgets: "opening", "stop opening". `note` may be empty.
  /// Returns whether the user stops it.
  bool draw(const BackgroundJob& job, const std::string& name, const std::string& note = {});

 private:
  const Rectangle picture_;
  Window& window_;
  float below_ = 0;  // of those before
};

}  // namespace curvisplat
