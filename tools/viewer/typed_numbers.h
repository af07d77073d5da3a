// Fields for numbers that take effect when they are left: by Return, by Tab or by a click elsewhere.
#pragma once

#include <array>
#include <optional>
#include <span>

namespace curvisplat {

/// For any number of fields, of which one at a time is typed into. On the window's thread.
class TypedNumbers {
 public:
  static constexpr size_t kMax = 2;
  /// One field for each of `values`, beside each other. Returns what was typed, once, when all of them have been left;
  /// Escape takes back what was typed. `label` is Dear ImGui's, `format` is printf's.
  std::optional<std::array<double, kMax>> draw(const char* label, std::span<const double> values,
                                               const char* format);

 private:
  unsigned field_ = 0;  // that is typed into, by Dear ImGui's identifier
  std::array<double, kMax> typed_{};
  bool tabs_ = false;  // the last frame: another of its fields may be entered now
};

}  // namespace curvisplat
