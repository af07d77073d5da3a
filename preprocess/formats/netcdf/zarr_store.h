// The files of a Zarr store: a folder, or a ZIP archive whose members are stored as they are, as zarr writes it. Any
// number of threads may read.
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
  /// Throws Error if it is an archive that is damaged or has a list of more than 256 MiB.
  explicit ZarrStore(const std::filesystem::path& path);

  /// nullopt if there is no such file: the chunk or the attributes were not written. `key`: "NAME/.zarray". Throws
  /// Error for a member of an archive that is compressed by it.
  std::optional<ZarrValue> find(const std::string& key) const;
  /// The name of a file, for messages.
  std::string nameOf(const std::string& key) const { return (path_ / key).string(); }
  /// The folders of the store's root, in order.
  std::vector<std::string> folders() const;
  /// Whether the files below a folder have `bytes` bytes or more. Looks at no more than it needs.
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
