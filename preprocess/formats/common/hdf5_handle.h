// RAII handles for HDF5's identifiers, and the lock that every call into HDF5, closing included, holds.
#pragma once

#include <hdf5.h>

#include <utility>

#include "preprocess/formats/common/data_library_lock.h"

namespace curvisplat {

/// An identifier that HDF5 returned; false if the call failed.
template <herr_t (*kClose)(hid_t)>
class Hdf5Handle {
 public:
  explicit Hdf5Handle(hid_t id = H5I_INVALID_HID) : id_(id) {}
  ~Hdf5Handle() {
    if (id_ >= 0) kClose(id_);
  }
  Hdf5Handle(Hdf5Handle&& other) noexcept : id_(std::exchange(other.id_, H5I_INVALID_HID)) {}
  Hdf5Handle& operator=(Hdf5Handle&& other) noexcept {
    std::swap(id_, other.id_);
    return *this;
  }

  explicit operator bool() const { return id_ >= 0; }
  hid_t id() const { return id_; }

 private:
  hid_t id_;
};

using Hdf5File = Hdf5Handle<H5Fclose>;
using Hdf5Group = Hdf5Handle<H5Gclose>;
using Hdf5DataSet = Hdf5Handle<H5Dclose>;
using Hdf5Attribute = Hdf5Handle<H5Aclose>;
using Hdf5Type = Hdf5Handle<H5Tclose>;
using Hdf5Space = Hdf5Handle<H5Sclose>;

/// Holds dataLibraryMutex(), and stops HDF5 from printing its error stack: failures are thrown as Error. HDF5
/// keeps this setting for each thread, so every thread that calls HDF5 or libnetcdf needs it. It stays after
/// the scope, as libnetcdf leaves it: at the end of the process HDF5 prints what a damaged file left open.
class QuietHdf5 {
 public:
  QuietHdf5() : lock_(dataLibraryMutex()) {
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
    // What HDF5 has freed it keeps for itself, up to 16 MiB and more, which no plan of the memory knows.
    constexpr int kAll = 1 << 20, kList = 1 << 16;
    static const herr_t limited = H5set_free_list_limits(kAll, kList, kAll, kList, kAll, kList);
    static_cast<void>(limited);
  }
  QuietHdf5(const QuietHdf5&) = delete;
  QuietHdf5& operator=(const QuietHdf5&) = delete;

 private:
  MutexLock lock_;
};

}  // namespace curvisplat
