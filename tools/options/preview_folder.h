// The folder of a cache that is shown before the whole is complete. It is there as long as someone holds it: the
// conversion, or a view, which opens the cache's files by their paths.
#pragma once

#include <filesystem>
#include <string>

namespace curvisplat {

class PreviewFolder {
 public:
  /// Makes `place`/`name`.<process number>.<n>, which no other has, and locks it. Throws Error if it cannot.
  PreviewFolder(const std::filesystem::path& place, const std::string& name);
  /// Removes it with all in it, unless kept.
  ~PreviewFolder();
  PreviewFolder(const PreviewFolder&) = delete;
  PreviewFolder& operator=(const PreviewFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  void keep() { keep_ = true; }

  /// Removes those of `name` in `place` whose process has ended. Not while another process makes one there.
  static void removeLeftOnes(const std::filesystem::path& place, const std::string& name);

 private:
  const std::filesystem::path path_;
  bool keep_ = false;
  int lock_ = -1;
};

}  // namespace curvisplat
