// The files of a Zarr store, which is a folder, or a ZIP archive that does not compress its members, as zarr
// writes it. Any number of threads may read.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stream/base/file.h"

namespace curvisplat {

/// The bytes of one file of a store, which may be part of an archive.
struct ZarrValue {
  std::shared_ptr<const InputFile> file;
  uint64_t begin = 0, size = 0;

  std::vector<std::byte> read(uint64_t first, uint64_t count) const;
  std::string text() const;  // at most 16 MiB
};

class ZarrStore {
 public:
  /// Throws Error if the path is an archive that is damaged or whose list of members exceeds 256 MiB.
  explicit ZarrStore(const std::filesystem::path& path);

  /// Finds a file by its path in the store, such as "NAME/.zarray". Gives nullopt if it does not exist: the
  /// chunk or the attributes were not written. Throws Error if it is a compressed member of an archive.
  std::optional<ZarrValue> find(const std::string& key) const;
  /// The file's name for messages: the store's path and the key.
  std::string nameOf(const std::string& key) const { return (path_ / key).string(); }
  /// Names of the folders in the store's root, sorted.
  std::vector<std::string> folders() const;
  /// Whether the files below a folder have `bytes` bytes or more in sum. Stops as soon as they have.
  bool hasBytes(const std::string& folder, double bytes) const;

 private:
  struct Member {
    uint64_t header = 0, size = 0, stored = 0;
    int method = 0;
  };
  void readDirectory();

  std::filesystem::path path_;
  std::shared_ptr<const InputFile> archive_;
  std::map<std::string, Member, std::less<>> members_;
  std::string root_;  // the folder of the archive that the store is in, with a slash; usually empty
};

/// Whether the file begins as a ZIP archive.
bool isZip(const InputFile& file);

}  // namespace curvisplat
