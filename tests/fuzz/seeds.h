// Writes the seeds of fuzzing, and puts their bytes together.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "tests/support/test_caches.h"

namespace curvisplat {

/// Puts an input together.
class Seed {
 public:
  template <typename T>
  Seed& add(const T& value) {
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
    return *this;
  }
  Seed& bytes(std::span<const std::byte> bytes) {
    bytes_.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    return *this;
  }
  Seed& text(std::string_view text) {
    bytes_ += text;
    return *this;
  }
  const std::string& whole() const { return bytes_; }

 private:
  std::string bytes_;
};

class Seeds {
 public:
  explicit Seeds(std::filesystem::path folder) : folder_(std::move(folder)) {}

  void write(const std::string& target, const std::string& name, const std::string& bytes) const {
    std::filesystem::create_directories(folder_ / target);
    overwriteFile(folder_ / target / name, bytes);
  }

 private:
  std::filesystem::path folder_;
};

/// Writes seeds of the cache's files.
void writeCacheSeeds(const Seeds& seeds);
/// Writes seeds of grids, surfaces and pictures.
void writeInputSeeds(const Seeds& seeds);

}  // namespace curvisplat
