#include "tools/python/array_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "stream/base/error.h"

namespace py = pybind11;

namespace curvisplat::python {
namespace {

using Shape = std::array<uint64_t, 3>;  // k, j, i

std::string textOf(const Shape& shape) {
  return fmt::format("({}, {}, {})", shape[0], shape[1], shape[2]);
}

/// A numpy array of three dimensions that is read without Python: it keeps what it looks at alive.
class ArrayView {
 public:
  ArrayView(py::array array, const std::string& what) : array_(std::move(array)) {
    const py::dtype type = array_.dtype();
    if (type.is(py::dtype::of<float>()))
      kind_ = Kind::kFloat;
    else if (type.is(py::dtype::of<double>()))
      kind_ = Kind::kDouble;
    else if (type.is(py::dtype::of<bool>()))
      kind_ = Kind::kBool;
    else
      throw UsageError("{}: the array has the type {}; expected float32 or float64 (use .astype)", what,
                       std::string(py::str(py::handle(type))));
    if (array_.ndim() != 3)
      throw UsageError("{}: the array has {} dimensions; expected three, (k, j, i)", what, array_.ndim());
    data_ = static_cast<const std::byte*>(array_.data());
    for (int axis = 0; axis < 3; ++axis) {
      shape_[axis] = static_cast<uint64_t>(array_.shape(axis));
      strides_[axis] = array_.strides(axis);
    }
  }

  const Shape& shape() const { return shape_; }
  bool isBool() const { return kind_ == Kind::kBool; }
  bool isDouble() const { return kind_ == Kind::kDouble; }

  /// The row (k, j, all i) into `out`, which has shape()[2] elements.
  template <typename T>
  void copyRow(uint64_t k, uint64_t j, T* out) const {
    const std::byte* row =
        data_ + static_cast<ptrdiff_t>(k) * strides_[0] + static_cast<ptrdiff_t>(j) * strides_[1];
    switch (kind_) {
      case Kind::kFloat:
        return copyRowOf<float>(row, out);
      case Kind::kDouble:
        return copyRowOf<double>(row, out);
      case Kind::kBool:
        return copyRowOf<bool>(row, out);
    }
  }

 private:
  enum class Kind { kFloat, kDouble, kBool };

  template <typename Stored, typename T>
  void copyRowOf(const std::byte* row, T* out) const {
    for (uint64_t i = 0; i < shape_[2]; ++i)
      out[i] =
          static_cast<T>(*reinterpret_cast<const Stored*>(row + static_cast<ptrdiff_t>(i) * strides_[2]));
  }

  py::array array_;
  Kind kind_;
  const std::byte* data_;
  Shape shape_{};
  std::array<ptrdiff_t, 3> strides_{};
};

void requireShape(const ArrayView& array, const Shape& expected, const std::string& what) {
  if (array.shape() != expected)
    throw UsageError("{}: the array has the shape {}; expected {}, as x has", what, textOf(array.shape()),
                     textOf(expected));
}

struct BlockViews {
  ArrayView x, y, z;
  std::vector<ArrayView> scalars;
  std::optional<ArrayView> blank;
};

BlockViews viewsOf(const BlockArrays& block, const ScalarNames& names) {
  const auto named = [&](const char* what) { return fmt::format("{}: {}", block.name, what); };
  BlockViews views{{block.x, named("x")}, {block.y, named("y")}, {block.z, named("z")}, {}, {}};
  const Shape shape = views.x.shape();
  requireShape(views.y, shape, named("y"));
  requireShape(views.z, shape, named("z"));
  for (const ArrayView* array : {&views.x, &views.y, &views.z})
    if (array->isBool())
      throw UsageError("{}: coordinates are of type bool; expected float32 or float64", block.name);
  if (block.scalars.size() != names.size())
    throw UsageError("{}: has {} scalars and the first block {}; all blocks need the same ones", block.name,
                     block.scalars.size(), names.size());
  for (size_t n = 0; n < names.size(); ++n)
    views.scalars.emplace_back(block.scalars[n], named(names[n].first.c_str()));
  if (!block.blank.is_none()) {
    views.blank.emplace(py::cast<py::array>(block.blank), named("blank"));
    requireShape(*views.blank, shape, named("blank"));
    if (!views.blank->isBool()) throw UsageError("{}: blank is not of type bool", block.name);
  }
  return views;
}

/// Node or cell, by the shape; throws if it is neither.
Centring centringOf(const ArrayView& scalar, const Shape& nodes, const std::string& what) {
  if (scalar.shape() == nodes) return Centring::kNode;
  const Shape cells{nodes[0] - 1, nodes[1] - 1, nodes[2] - 1};
  if (std::min({nodes[0], nodes[1], nodes[2]}) > 1 && scalar.shape() == cells) return Centring::kCell;
  throw UsageError("{}: the array has the shape {}; expected {} (values at nodes) or {} (in cells)", what,
                   textOf(scalar.shape()), textOf(nodes), textOf(cells));
}

std::vector<GridScalar> describedScalars(const ScalarNames& names) {
  std::vector<GridScalar> scalars;
  for (const auto& [name, unit] : names) {
    GridScalar& scalar = scalars.emplace_back();
    scalar.name = name;
    scalar.unit = unit;
  }
  return scalars;
}

class ArraySource : public GridSource {
 public:
  ArraySource(std::vector<BlockArrays> blocks, const ScalarNames& names, std::optional<double> time) {
    description_.format = "arrays in memory";
    if (time) description_.times = {*time};
    description_.scalars = describedScalars(names);
    description_.coordinate_bytes = 4;
    for (const BlockArrays& block : blocks) {
      views_.push_back(viewsOf(block, names));
      const BlockViews& views = views_.back();
      const Shape& shape = views.x.shape();
      description_.blocks.push_back({block.name, shape[2], shape[1], shape[0], views.blank.has_value()});
      if (views.x.isDouble() || views.y.isDouble() || views.z.isDouble()) description_.coordinate_bytes = 8;
      for (size_t n = 0; n < names.size(); ++n) {
        const std::string what = fmt::format("{}: {}", block.name, names[n].first);
        const Centring centring = centringOf(views.scalars[n], shape, what);
        if (views_.size() > 1 && centring != description_.scalars[n].centring)
          throw UsageError("{}: at nodes in one block and in cells in another", what);
        description_.scalars[n].centring = centring;
      }
    }
  }

  /// In whichever thread: a series frees its steps where it converts them.
  ~ArraySource() override {
    const py::gil_scoped_acquire locked;
    views_.clear();
  }

  const GridDescription& description() const override { return description_; }

  void read(uint32_t number, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    const BlockViews& views = views_[number];
    const uint64_t ni = views.x.shape()[2], rows = (box.j1 - box.j0) * (box.k1 - box.k0);
    for (std::vector<double>* coordinate : {&out.x, &out.y, &out.z}) coordinate->resize(rows * ni);
    out.blank.assign(rows * ni, 0);
    out.scalars.resize(scalars.size());
    for (std::vector<float>& values : out.scalars)
      values.assign(rows * ni, std::numeric_limits<float>::quiet_NaN());
    uint64_t at = 0;
    for (uint64_t k = box.k0; k < box.k1; ++k)
      for (uint64_t j = box.j0; j < box.j1; ++j, at += ni) {
        views.x.copyRow(k, j, &out.x[at]);
        views.y.copyRow(k, j, &out.y[at]);
        views.z.copyRow(k, j, &out.z[at]);
        if (views.blank) views.blank->copyRow(k, j, &out.blank[at]);
        for (size_t n = 0; n < scalars.size(); ++n) {
          const ArrayView& values = views.scalars[scalars[n]];
          if (k < values.shape()[0] && j < values.shape()[1]) values.copyRow(k, j, &out.scalars[n][at]);
        }
      }
  }

 private:
  GridDescription description_;
  std::vector<BlockViews> views_;  // [block]
};

class CallableSource : public GridSource {
 public:
  CallableSource(const std::vector<Shape>& shapes, const ScalarNames& names, py::object read)
      : read_(std::move(read)) {
    description_.format = "a Python callable";
    description_.coordinate_bytes = 8;
    for (const Shape& shape : shapes)
      description_.blocks.push_back(
          {fmt::format("block {}", description_.blocks.size() + 1), shape[2], shape[1], shape[0], true});
    description_.scalars = describedScalars(names);
  }
  ~CallableSource() override {
    const py::gil_scoped_acquire locked;
    read_ = py::object();
  }

  const GridDescription& description() const override { return description_; }

  void read(uint32_t number, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    const GridBlock& block = description_.blocks[number];
    const Shape shape{box.k1 - box.k0, box.j1 - box.j0, block.ni};
    const py::gil_scoped_acquire locked;
    py::list wanted;
    for (const uint32_t scalar : scalars) wanted.append(description_.scalars[scalar].name);
    const auto result = py::cast<py::tuple>(read_(number, box.k0, box.k1, box.j0, box.j1, wanted));
    if (result.size() != 5)
      throw Error("read() returned {} items; expected (x, y, z, [values], blank)", result.size());
    copy(result[0], "x", shape, out.x);
    copy(result[1], "y", shape, out.y);
    copy(result[2], "z", shape, out.z);
    const auto values = py::cast<py::list>(result[3]);
    if (values.size() != scalars.size())
      throw Error("read() returned {} arrays of values; expected {}", values.size(), scalars.size());
    out.scalars.resize(scalars.size());
    for (size_t n = 0; n < scalars.size(); ++n)
      copy(values[n], description_.scalars[scalars[n]].name, shape, out.scalars[n]);
    out.blank.assign(out.x.size(), 0);
    if (!result[4].is_none()) copy(result[4], "blank", shape, out.blank);
  }

 private:
  template <typename T>
  static void copy(const py::handle& object, const std::string& what, const Shape& shape,
                   std::vector<T>& out) {
    const ArrayView view(py::cast<py::array>(object), "read(): " + what);
    requireShape(view, shape, "read(): " + what);
    out.resize(shape[0] * shape[1] * shape[2]);
    for (uint64_t k = 0; k < shape[0]; ++k)
      for (uint64_t j = 0; j < shape[1]; ++j) view.copyRow(k, j, &out[(k * shape[1] + j) * shape[2]]);
  }

  GridDescription description_;
  py::object read_;
};

}  // namespace

std::unique_ptr<GridSource> sourceOfArrays(std::vector<BlockArrays> blocks, const ScalarNames& names,
                                           std::optional<double> time) {
  return std::make_unique<ArraySource>(std::move(blocks), names, time);
}

std::unique_ptr<GridSource> sourceOfCallable(const std::vector<std::array<uint64_t, 3>>& shapes,
                                             const ScalarNames& names, py::object read) {
  return std::make_unique<CallableSource>(shapes, names, std::move(read));
}

}  // namespace curvisplat::python
