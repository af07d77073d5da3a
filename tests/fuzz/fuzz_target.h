// Defines fuzz targets: a function of bytes that returns, or throws an Error of one line, whatever they are.
// Anything else (a signal, a failed check, another exception, a finding of a sanitizer) is a finding.
//
// The same function is run by libFuzzer (preset "fuzz", a program for each target), and on every input of corpus/<target>/ by the
// ordinary tests (replay_test.cpp, all targets in one program).
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace curvisplat {

struct FuzzTarget {
  const char* name;  // its corpus folder's, too
  void (*run)(std::span<const std::byte> bytes);
};

/// All that are linked into the program.
std::vector<FuzzTarget>& fuzzTargets();

/// Runs `target`. The Error's text, or "" if it threw none; aborts where it throws anything but an Error of
/// one line.
std::string runFuzzTarget(const FuzzTarget& target, std::span<const std::byte> bytes);

/// Registers a target: for namespace scope.
struct RegisteredFuzzTarget {
  RegisteredFuzzTarget(const char* name, void (*run)(std::span<const std::byte>)) {
    fuzzTargets().push_back({name, run});
  }
};

/// Takes an input apart from its front. Where it ends, zeros go on.
class FuzzInput {
 public:
  explicit FuzzInput(std::span<const std::byte> bytes) : rest_(bytes) {}

  template <typename T>
  T take() {
    T value{};
    const auto bytes = takeBytes(sizeof value);
    if (!bytes.empty()) std::memcpy(&value, bytes.data(), bytes.size());
    return value;
  }
  /// Takes at most `count` bytes.
  std::span<const std::byte> takeBytes(size_t count) {
    const auto taken = rest_.first(count < rest_.size() ? count : rest_.size());
    rest_ = rest_.subspan(taken.size());
    return taken;
  }
  std::span<const std::byte> rest() const { return rest_; }

 private:
  std::span<const std::byte> rest_;
};

inline std::string_view textOf(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// A file of the target's own folder, which is in TMPDIR and goes with the process. For formats that are read
/// from files; on tmpfs that costs some microseconds.
std::filesystem::path fuzzFile(std::string_view name, std::span<const std::byte> bytes);
std::filesystem::path fuzzFolder();

}  // namespace curvisplat
