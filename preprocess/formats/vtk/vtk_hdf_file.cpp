#include "preprocess/formats/vtk/vtk_hdf_file.h"

#include <fmt/format.h>

#include <utility>

namespace curvisplat {
namespace {

/// A part of an HDF5 array as bytes.
class Hdf5Bytes final : public ByteSource {
 public:
  Hdf5Bytes(std::shared_ptr<const Hdf5Array> array, uint64_t first, uint64_t values)
      : array_(std::move(array)), first_(first), values_(values) {}

  uint64_t size() const override { return values_ * array_->bytes(); }
  void readAt(uint64_t offset, std::span<std::byte> to) const override {
    array_->readStored(first_ + offset / array_->bytes(), to);
  }

 private:
  std::shared_ptr<const Hdf5Array> array_;
  uint64_t first_ = 0, values_ = 0;
};

VtkType typeOf(const Hdf5Array& array) {
  if (array.isFloat()) return array.bytes() == 4 ? VtkType::kFloat32 : VtkType::kFloat64;
  switch (array.bytes()) {
    case 1:
      return array.isSigned() ? VtkType::kInt8 : VtkType::kUint8;
    case 2:
      return array.isSigned() ? VtkType::kInt16 : VtkType::kUint16;
    case 4:
      return array.isSigned() ? VtkType::kInt32 : VtkType::kUint32;
    default:
      return array.isSigned() ? VtkType::kInt64 : VtkType::kUint64;
  }
}

}  // namespace

VtkArray vtkArrayOf(std::string name, std::shared_ptr<const Hdf5Array> array, uint64_t first, uint64_t tuples,
                    uint32_t components) {
  VtkArray of;
  of.name = std::move(name);
  of.type = typeOf(*array);
  of.components = components;
  of.tuples = tuples;
  of.order = kMachineByteOrder;
  of.bytes = std::make_shared<Hdf5Bytes>(std::move(array), first, tuples * components);
  return of;
}

VtkArray VtkHdfFile::tuples(const std::string& place, uint64_t first, uint64_t tuples) const {
  auto of = required(place);
  const uint64_t rows = of->dims().front(), components = rows == 0 ? 1 : of->size() / rows;
  if (first > rows || tuples > rows - first)
    fail(place, fmt::format("has {} tuples; expected {} from number {} on; the file is damaged", rows, tuples,
                            first));
  if (components == 0 || components > kMaxComponents)
    fail(place, fmt::format("has {} components; expected at most {}", components, kMaxComponents));
  return vtkArrayOf(place.substr(place.rfind('/') + 1), std::move(of), first * components, tuples,
                    static_cast<uint32_t>(components));
}

}  // namespace curvisplat
