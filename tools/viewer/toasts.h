// Messages over the picture, which go away by themselves; the last ones can be read again. Knows no window.
//
// A message stays long enough to be read. An error stays until it is clicked away, or for a minute.
#pragma once

#include <deque>
#include <string>

namespace curvisplat {

struct Toast {
  std::string text;
  bool is_error = false;
  double ends_s = 0;
};

class Toasts {
 public:
  /// `now_s` is any clock's. The same text again only stays longer: then it returns false.
  bool add(const std::string& text, double now_s, bool is_error = false);
  /// Those that are to be seen at `now_s`, the newest last.
  const std::deque<Toast>& shown(double now_s);
  /// One of shown() goes now.
  void remove(size_t n);
  /// All of them go.
  void removeAll() { shown_.clear(); }
  /// All, the newest last; the oldest of more than 100 are forgotten.
  const std::deque<std::string>& log() const { return log_; }

 private:
  std::deque<Toast> shown_;
  std::deque<std::string> log_;
};

}  // namespace curvisplat
