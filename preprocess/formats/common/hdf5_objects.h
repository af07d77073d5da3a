// The objects of an open HDF5 file: handles that close themselves, the shape of an attribute, and lists of
// links and attributes that are checked before they are read; and the lock of the data libraries.
//
// libcgns, HDF5 and NetCDF keep global lists of open files and global error stacks without any lock. Every
// call into any of them, by any reader, therefore holds dataLibraryMutex(), and their reads run one after
// the other. Closing a handle is such a call, too.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "preprocess/formats/common/hdf5_library.h"
#include "stream/base/mutex.h"

namespace curvisplat {

/// Guards the global state of libcgns, HDF5 and NetCDF.
Mutex& dataLibraryMutex();

/// An identifier that HDF5 returned, which is closed with the handle; false if the call failed.
template <const LibraryFunction<herr_t(hid_t)>& kClose>
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
using Hdf5Object = Hdf5Handle<H5Oclose>;
using Hdf5Properties = Hdf5Handle<H5Pclose>;

/// Holds dataLibraryMutex(), and stops HDF5 from printing its error stack: failures are thrown as Error.
/// HDF5 keeps this setting for each thread, so every thread that calls HDF5 or libnetcdf needs it. It stays
/// after the scope, as libnetcdf leaves it: at the end of the process HDF5 prints what a damaged file left
/// open.
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

/// The type, size and extent of an attribute, so that it can be checked before it is read into a buffer: by
/// this program, or by a library that trusts the file.
struct Hdf5AttributeShape {
  H5T_class_t kind = H5T_NO_CLASS;
  H5T_class_t element_kind = H5T_NO_CLASS;  // of H5T_VLEN and H5T_ARRAY: the class of their elements
  size_t value_bytes = 0;
  int rank = 0;
  uint64_t values = 0;           // 0: a null or empty extent
  bool variable_string = false;  // values are pointers to strings

  /// "11 strings of 3 bytes", for error messages.
  std::string describe() const;
};

/// Whether a data set with these properties takes its values from others.
inline bool isVirtual(const Hdf5Properties& properties) {
  return properties && H5Pget_layout(properties.id()) == H5D_VIRTUAL;
}

/// "integers", "strings", ...: the values of a type, for error messages.
const char* describe(H5T_class_t kind);

/// The innermost entry of HDF5's error stack after a failed call.
std::string hdf5Reason();

/// The shape of an attribute; nullopt if HDF5 cannot read it, and hdf5Reason() tells why.
std::optional<Hdf5AttributeShape> shapeOf(const Hdf5Attribute& attribute);

// HDF5 (1.10) sorts the links and attributes of an object if they are read in another order than the file's.
// If a stored list is damaged, or its length is not the one that the object states, HDF5 then frees entries
// of the sorted list that it has not set, and writes beyond its end. linksAreWhole() and attributesAreWhole() read in the
// file's own order, which sorts nothing.

/// Whether the links of `group` can be read, and their number is the one that it states. The caller holds
/// dataLibraryMutex().
bool linksAreWhole(hid_t group);

struct Hdf5Link {
  std::string name;
  bool external = false;
};

/// The links of a group, in order of creation if the file tracks it, else by name. nullopt if the group
/// cannot be read. The caller holds dataLibraryMutex().
std::optional<std::vector<Hdf5Link>> linksOf(hid_t group);

/// Whether the attributes of `object` can be read, and their number is the one that it states. The caller
/// holds dataLibraryMutex().
bool attributesAreWhole(hid_t object);

}  // namespace curvisplat
