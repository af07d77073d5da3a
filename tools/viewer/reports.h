// What the window says. The one place that decides what happens to an error, wherever it comes from: it is shown over the
// picture and printed, and the window goes on with what it has. Only Interrupted passes, which ends the program.
#pragma once

#include <exception>
#include <functional>
#include <string>

#include "tools/viewer/toasts.h"

namespace curvisplat {

class Reports {
 public:
  /// `clock_s` tells the time for `toasts`, which must outlive this.
  Reports(Toasts& toasts, double (*clock_s)()) : toasts_(toasts), clock_s_(clock_s) {}

  void say(const std::string& text) { toasts_.add(text, clock_s_()); }
  /// Does `act`; false if it threw. What it throws is reported.
  bool attempt(const std::function<void()>& act);
  /// Shows and prints it, once as long as it is shown.
  void report(const std::exception& error);
  void report(const std::string& text);

 private:
  Toasts& toasts_;
  double (*const clock_s_)();
};

}  // namespace curvisplat
