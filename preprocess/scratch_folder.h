// The folder of a conversion's temporary files: made for it, and removed with all in it when it ends, unless
// another is to go on with them.
#pragma once

#include <filesystem>
#include <string>
#include <utility>

namespace curvisplat {

class ScratchFolder {
 public:
  /// Makes `parent`/`name`.<process number>. Throws Error if it cannot.
  ScratchFolder(const std::filesystem::path& parent, const std::string& name);
  /// Takes over a folder that was left.
  explicit ScratchFolder(std::filesystem::path left) : path_(std::move(left)) {}
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  /// The destructor leaves the folder.
  void leave() { leave_ = true; }

 private:
  std::filesystem::path path_;
  bool leave_ = false;
};

}  // namespace curvisplat
