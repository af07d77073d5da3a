// A display without a screen, and the hands and eyes of who sits before it: Xvfb, xdotool.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "render/image/image.h"

namespace curvisplat {

class VirtualDisplay {
 public:
  /// The programs that it needs and that are not installed; empty if all are.
  static std::string missing();

  /// Sets DISPLAY for programs to come. `options` of Xvfb, beside ours. A server that the last display of this size and these options has
  /// left is taken over once its screen is black, with all keys and buttons up: starting one takes a third of a second.
  explicit VirtualDisplay(ImageSize size, const std::vector<std::string>& options = {});
  ~VirtualDisplay();

  /// xdotool's words: {"mousemove", "10", "20"}, {"key", "p"}. Throws where it fails.
  void act(const std::vector<std::string>& words) const;
  /// A picture of the screen.
  Image screenshot() const;
  /// How bright a pixel of the screen is: the sum of its colours, from 0 to 3. Costs a thousandth of a picture of all.
  float brightness(int x, int y) const;

 private:
  class Server;

  static std::unique_ptr<Server>& idleServer();

  std::unique_ptr<Server> server_;
};

/// Asks again and again until `holds` or `seconds` have passed; whether it held.
[[nodiscard]] bool eventually(const std::function<bool()>& holds, double seconds = 60);

}  // namespace curvisplat
