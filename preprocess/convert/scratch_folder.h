// The folder of a conversion's temporary files: made for it, and removed with all in it when it ends, unless
// another is to go on with them.
#pragma once

#include <filesystem>
#include <string>

namespace curvisplat {

class ScratchFolder {
 public:
  /// How names of temporary folders for a cache begin: so much of its name that what follows fits, too.
  static std::string beginOfName(const std::filesystem::path& cache);
  /// A name that no other process uses: `parent`/`name`.<process number>.<n>
  static std::filesystem::path newPath(const std::filesystem::path& parent, const std::string& name);

  enum class Folder { kMake, kTakeOver };
  /// Makes the folder, which must not exist, or takes over one that was left. Throws Error if it cannot.
  ScratchFolder(std::filesystem::path path, Folder folder);
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
