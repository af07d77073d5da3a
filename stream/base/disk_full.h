// The error of a write for which there is no room: whoever knows what the file is for can say so.
#pragma once

#include <filesystem>
#include <string>
#include <utility>

#include "stream/base/error.h"

namespace curvisplat {

class DiskFull : public OutputError {
 public:
  /// `reason`: the system's words. `text`: the whole message, of this file.
  DiskFull(std::filesystem::path file, std::string reason, const std::string& text)
      : OutputError(text), file_(std::move(file)), reason_(std::move(reason)) {}

  const std::filesystem::path& file() const { return file_; }
  const std::string& reason() const { return reason_; }

 private:
  std::filesystem::path file_;
  std::string reason_;
};

}  // namespace curvisplat
