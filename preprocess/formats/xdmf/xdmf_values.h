// The numbers of an XDMF DataItem, wherever they are: in an HDF5 file, in a binary file, in the XML itself, or as a part of
// another item (HyperSlab).
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "preprocess/formats/common/byte_source.h"

namespace curvisplat {

/// A part of an array: where it begins, its step and its count along each dimension.
struct XdmfSlab {
  std::vector<uint64_t> start, stride, count;
};

/// Any number of threads may read.
class XdmfValues {
 public:
  virtual ~XdmfValues() = default;
  /// The lengths of all dimensions: the slowest comes first.
  const std::vector<uint64_t>& dims() const { return dims_; }
  uint64_t size() const { return size_; }
  /// Bytes of a value as it is stored: 4 or 8 for single and double precision.
  virtual int valueBytes() const = 0;
  /// The numbers [first, first + to.size()), in the order of the file. Throws Error with the file.
  virtual void read(uint64_t first, std::span<double> to) const = 0;
  /// The numbers of a part, which must be within the dimensions, in the order of the file. Needs a buffer of 256 KiB
  /// whatever the steps.
  virtual void readPart(const XdmfSlab& part, std::span<double> to) const;

 protected:
  /// Throws Error if the product is no number of values that a file can hold. `where`: for messages.
  XdmfValues(std::vector<uint64_t> dims, const std::string& where);

 private:
  std::vector<uint64_t> dims_;
  uint64_t size_ = 1;
};

struct XdmfBinary {
  std::shared_ptr<const PooledFile> file;
  std::string where;  // what names the file, for messages
  uint64_t seek = 0;
  char kind = 'f';  // f: floating point, i: integers, u: without sign
  int bytes = 4;
  bool swap = false;
};
std::shared_ptr<const XdmfValues> openXdmfBinary(const XdmfBinary& binary, std::vector<uint64_t> dims);

/// Numbers in memory.
std::shared_ptr<const XdmfValues> xdmfInline(std::vector<double> numbers, std::vector<uint64_t> dims,
                                             const std::string& where);

/// Tuples of one number of each of the parts (XDMF's JOIN): a further dimension, the fastest. Throws Error unless the
/// parts, one at least, have the same size.
std::shared_ptr<const XdmfValues> xdmfJoined(std::vector<std::shared_ptr<const XdmfValues>> parts,
                                             const std::string& where);

/// A part of another item. Throws Error if it does not have it.
std::shared_ptr<const XdmfValues> xdmfHyperslab(std::shared_ptr<const XdmfValues> all, XdmfSlab slab,
                                                const std::string& where);

}  // namespace curvisplat
