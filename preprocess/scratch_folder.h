// The folder of a conversion's temporary files: made for it, and removed with all in it when it ends, however
// it ends.
#pragma once

#include <filesystem>

namespace curvisplat {

class ScratchFolder {
 public:
  /// Makes `parent`/`name`.<process number>. Throws Error if it cannot.
  ScratchFolder(const std::filesystem::path& parent, const std::string& name);
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace curvisplat
