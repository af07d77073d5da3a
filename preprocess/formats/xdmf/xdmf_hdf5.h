// The arrays of XDMF files in HDF5 files. A file of many grids names thousands of data sets; an open one costs a chunk
// cache of 1 MiB and often a file descriptor, so only the last ones read are open.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <list>
#include <memory>
#include <string>
#include <vector>

#include "preprocess/formats/common/hdf5_handle.h"
#include "preprocess/formats/xdmf/xdmf_values.h"

namespace curvisplat {

/// The open data sets, most recently used first. Guarded by dataLibraryMutex(), closing included.
class XdmfHdf5Sets {
 public:
  XdmfHdf5Sets() = default;
  ~XdmfHdf5Sets();
  XdmfHdf5Sets(const XdmfHdf5Sets&) = delete;
  XdmfHdf5Sets& operator=(const XdmfHdf5Sets&) = delete;

  /// Calls use(identifier) with the mutex held; opens the data set unless it is open. Throws Error.
  void with(const std::filesystem::path& path, const std::string& name,
            const std::function<void(hid_t)>& use);

 private:
  struct Open {
    std::filesystem::path path;
    std::string name;
    Hdf5File file;
    Hdf5DataSet set;
  };
  bool moveToFront(const std::filesystem::path& path, const std::string& name);

  std::list<Open> open_;
};

/// Throws Error unless the data set has as many numbers as `dims` say. Reads of one thread wait for those of another.
std::shared_ptr<const XdmfValues> openXdmfHdf5(std::shared_ptr<XdmfHdf5Sets> sets,
                                               const std::filesystem::path& file, const std::string& name,
                                               std::vector<uint64_t> dims);

}  // namespace curvisplat
