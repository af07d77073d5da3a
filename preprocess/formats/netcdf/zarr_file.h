// A Zarr store as a NetCDF file: its arrays are the variables, and their attributes those of the CF conventions, as
// xarray, libnetcdf and other programs write them.
//
// It keeps 2 MiB of decompressed chunks for each array that is read, or one chunk where that is larger; a
// read decompresses the chunks that overlap the box, one at a time. A chunk that was not written has the fill
// value. Any number of threads may use it; their reads run one after the other.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <list>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "preprocess/formats/netcdf/netcdf_file.h"
#include "preprocess/formats/netcdf/zarr_array.h"
#include "preprocess/formats/netcdf/zarr_store.h"
#include "stream/base/mutex.h"

namespace curvisplat {

/// Whether the path is a folder with the files of a Zarr store, or a ZIP archive named .zip or .zarr. Never throws.
bool isZarrStore(const std::filesystem::path& path);

class ZarrFile final : public NetcdfFile {
 public:
  /// Throws Error with the file of the store that is damaged.
  explicit ZarrFile(const std::filesystem::path& path);

  void release() const override;
  std::string readText(const NetcdfVariable& variable) const override;
  std::vector<std::string> readStrings(const NetcdfVariable& variable) const override;

 private:
  using Bytes = std::vector<std::byte>;
  struct Chunk {
    std::vector<uint64_t> at;  // [axis], in chunks
    std::shared_ptr<const Bytes> bytes;
  };
  struct Cache {
    std::list<Chunk> chunks;  // the last used first
    size_t bytes = 0;
  };
  /// Receives `count` values along the last axis of a box, `stride` bytes apart, for the places from `to` on.
  /// `from` is null if the chunk was not written.
  using UseRun = std::function<void(const std::byte* from, size_t stride, size_t count, size_t to)>;

  void addArray(ZarrArray array);
  size_t dimensionOf(const ZarrArray& array, size_t axis);
  void requirePossible(const ZarrArray& array) const;
  void forEachRun(size_t number, const NetcdfBox& box, const UseRun& use) const;
  std::shared_ptr<const Bytes> chunkAt(size_t number, const std::vector<uint64_t>& at) const REQUIRES(mutex_);
  std::shared_ptr<const Bytes> loaded(const ZarrArray& array, const std::vector<uint64_t>& at) const;
  NetcdfBox allOf(const ZarrArray& array) const;
  void readStored(const NetcdfVariable& variable, const NetcdfBox& box, std::span<double> to) const override;
  void readStored(const NetcdfVariable& variable, const NetcdfBox& box, std::span<float> to) const override;
  template <typename Value>
  void readNumbers(const NetcdfVariable& variable, const NetcdfBox& box, std::span<Value> to) const;

  ZarrStore store_;
  std::vector<ZarrArray> arrays_;  // [variable]
  mutable Mutex mutex_;
  mutable std::vector<Cache> caches_ GUARDED_BY(mutex_);  // [variable]
};

/// Whether the path is a NetCDF file (NetcdfFile::recognises()) or a Zarr store.
bool isNetcdf(const std::filesystem::path& path);

/// Opens a NetCDF file or a Zarr store. Throws Error.
std::unique_ptr<NetcdfFile> openNetcdfFile(const std::filesystem::path& path);

}  // namespace curvisplat
