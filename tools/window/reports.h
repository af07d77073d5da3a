// The messages of the window. Toasts are shown over the picture and go away by themselves. Reports is the one place that
// decides what happens to an error, wherever it comes from: the error is shown over the picture and printed, and the window
// goes on with what it has. Only Interrupted is not caught: it ends the program.
//
// A message stays long enough to be read. An error stays until it is clicked away, until what failed succeeds, or for a minute. Nothing
// here knows the window. For the window's thread.
#pragma once

#include <deque>
#include <exception>
#include <functional>
#include <string>

namespace curvisplat {

/// Names what a message is about. An error goes when the next attempt at the same succeeds, another message when the next one of
/// the same comes.
enum class About { kNothing, kOpening, kPicture, kSaving, kFunction, kMarker };

struct Toast {
  std::string text;
  bool is_error = false;
  double ends_s = 0;
  About about = About::kNothing;
};

/// The messages that are shown, and the last ones, which can be read again. A value type.
class Toasts {
 public:
  /// Adds a message at the time `now_s` of any clock. A text that is shown already stays longer; then it returns false.
  bool add(const std::string& text, double now_s, bool is_error = false, About about = About::kNothing);
  /// Removes the errors about something that has succeeded.
  void settle(About about);
  /// The messages to show at `now_s`, the newest last.
  const std::deque<Toast>& shown(double now_s);
  /// Removes one of shown() now.
  void remove(size_t n);
  /// Removes all of them.
  void removeAll() { shown_.clear(); }
  /// All, the newest last; the oldest of more than 100 are forgotten.
  const std::deque<std::string>& log() const { return log_; }

 private:
  std::deque<Toast> shown_;
  std::deque<std::string> log_;
};

/// The message as the window shows it. Where it names an option, which the window does not have, the command that takes it is added.
std::string inWindowsWords(const std::string& message);

/// Shows and prints errors and messages.
class Reports {
 public:
  /// `clock_s` tells the time for `toasts`, which must outlive this.
  Reports(Toasts& toasts, double (*clock_s)()) : toasts_(toasts), clock_s_(clock_s) {}

  void say(const std::string& text, About about = About::kNothing) {
    toasts_.add(text, clock_s_(), false, about);
  }
  /// Calls `act`. Returns false if it threw an error, which is reported as one about `about`.
  bool attempt(const std::function<void()>& act, About about = About::kNothing);
  /// Shows and prints the error, but not again while it is shown.
  void report(const std::exception& error, About about = About::kNothing);
  void report(const std::string& text, About about = About::kNothing);
  /// Removes the errors about something that has succeeded.
  void settle(About about) { toasts_.settle(about); }

 private:
  Toasts& toasts_;
  double (*const clock_s_)();
};

}  // namespace curvisplat
