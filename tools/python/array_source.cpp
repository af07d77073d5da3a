#include "tools/python/array_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <type_traits>

#include "preprocess/convert/splat_record.h"
#include "preprocess/grid/slabs.h"
#include "stream/base/error.h"

namespace py = pybind11;

namespace curvisplat::python {
namespace {

using ArrayShape = std::array<uint64_t, 3>;  // k, j, i

std::string shapeText(const ArrayShape& shape) {
  return fmt::format("({}, {}, {})", shape[0], shape[1], shape[2]);
}

/// Indices along i.
struct Range {
  uint64_t begin, end;
};

/// A numpy array of three dimensions that is read without Python: it keeps what it looks at alive.
class ArrayView {
 public:
  ArrayView(py::array array, const std::string& what) : array_(std::move(array)) {
    const py::dtype type = array_.dtype();
    if (type.equal(py::dtype::of<float>()))
      kind_ = Kind::kFloat;
    else if (type.equal(py::dtype::of<double>()))
      kind_ = Kind::kDouble;
    else if (type.equal(py::dtype::of<bool>()))
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

  const ArrayShape& shape() const { return shape_; }
  bool isBool() const { return kind_ == Kind::kBool; }
  bool isDouble() const { return kind_ == Kind::kDouble; }

  /// The elements (k, j, i0 to i1) into `out`. Those beyond the end of the row are not there.
  template <typename T>
  void copyRow(uint64_t k, uint64_t j, const Range& i, T* out) const {
    const uint64_t end = std::min(i.end, shape_[2]), count = end - std::min(i.begin, end);
    const std::byte* first = data_ + static_cast<ptrdiff_t>(k) * strides_[0] +
                             static_cast<ptrdiff_t>(j) * strides_[1] +
                             static_cast<ptrdiff_t>(i.begin) * strides_[2];
    switch (kind_) {
      case Kind::kFloat:
        return copyElements<float>(first, count, out);
      case Kind::kDouble:
        return copyElements<double>(first, count, out);
      case Kind::kBool:
        return copyElements<uint8_t>(first, count, out);
    }
  }

 private:
  enum class Kind { kFloat, kDouble, kBool };

  /// Elements may lie at any address. As a bool every byte but 0 is true: views of other arrays have all of
  /// them.
  template <typename Stored, typename T>
  void copyElements(const std::byte* first, uint64_t count, T* out) const {
    for (uint64_t n = 0; n < count; ++n) {
      Stored element;
      std::memcpy(&element, first + static_cast<ptrdiff_t>(n) * strides_[2], sizeof element);
      if constexpr (std::is_same_v<Stored, uint8_t>)
        out[n] = static_cast<T>(element != 0);
      else
        out[n] = static_cast<T>(element);
    }
  }

  py::array array_;
  Kind kind_;
  const std::byte* data_;
  ArrayShape shape_{};
  std::array<ptrdiff_t, 3> strides_{};
};

void requireShape(const ArrayView& array, const ArrayShape& expected, const std::string& what) {
  if (array.shape() != expected)
    throw UsageError("{}: the array has the shape {}; expected {}, as x has", what, shapeText(array.shape()),
                     shapeText(expected));
}

struct BlockViews {
  ArrayView x, y, z;
  std::vector<ArrayView> scalars;
  std::optional<ArrayView> blank;
};

BlockViews viewsOf(const BlockArrays& block, const ScalarNames& names) {
  const auto named = [&](const char* what) { return fmt::format("{}: {}", block.name, what); };
  BlockViews views{{block.x, named("x")}, {block.y, named("y")}, {block.z, named("z")}, {}, {}};
  const ArrayShape shape = views.x.shape();
  if (std::min({shape[0], shape[1], shape[2]}) == 0)
    throw UsageError("{}: the array has the shape {}; expected at least one node", named("x"),
                     shapeText(shape));
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
Centring centringOf(const ArrayView& scalar, const ArrayShape& nodes, const std::string& what) {
  if (scalar.shape() == nodes) return Centring::kNode;
  const ArrayShape cells{nodes[0] - 1, nodes[1] - 1, nodes[2] - 1};
  if (std::min({nodes[0], nodes[1], nodes[2]}) > 1 && scalar.shape() == cells) return Centring::kCell;
  throw UsageError("{}: the array has the shape {}; expected {} (values at nodes) or {} (in cells)", what,
                   shapeText(scalar.shape()), shapeText(nodes), shapeText(cells));
}

/// Products of larger ones would not fit in 64 bits.
void requireFewNodes(const ArrayShape& shape) {
  uint64_t nodes = 1;
  for (const uint64_t length : shape) {
    if (length > 0 && nodes > (kMaxNodes - 1) / length)
      throw UsageError("the shape {} has too many nodes; at most {} can be converted", shapeText(shape),
                       kMaxNodes - 1);
    nodes *= std::max<uint64_t>(length, 1);
  }
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
    if (time && !std::isfinite(*time)) throw UsageError("time: {}; expected a finite number", *time);
    if (time) description_.times = {*time};
    description_.scalars = describedScalars(names);
    description_.coordinate_bytes = 4;
    for (const BlockArrays& block : blocks) {
      views_.push_back(viewsOf(block, names));
      const BlockViews& views = views_.back();
      const ArrayShape& shape = views.x.shape();
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

  /// Frees the arrays in whichever thread this is: a series frees its steps where it converts them.
  ~ArraySource() override {
    const py::gil_scoped_acquire locked;
    views_.clear();
  }

  const GridDescription& description() const override { return description_; }

  void read(uint32_t number, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    const BlockViews& views = views_[number];
    const uint64_t ni = views.x.shape()[2], row = box.rowNodes(ni), nodes = row * rowsOf(box);
    const Range part{box.i0, box.endOfRow(ni)};
    for (std::vector<double>* coordinate : {&out.x, &out.y, &out.z}) coordinate->resize(nodes);
    out.blank.assign(nodes, 0);
    out.scalars.resize(scalars.size());
    for (std::vector<float>& values : out.scalars)
      values.assign(nodes, std::numeric_limits<float>::quiet_NaN());
    uint64_t at = 0;
    for (uint64_t k = box.k0; k < box.k1; ++k)
      for (uint64_t j = box.j0; j < box.j1; ++j, at += row) {
        views.x.copyRow(k, j, part, &out.x[at]);
        views.y.copyRow(k, j, part, &out.y[at]);
        views.z.copyRow(k, j, part, &out.z[at]);
        if (views.blank) views.blank->copyRow(k, j, part, &out.blank[at]);
        for (size_t n = 0; n < scalars.size(); ++n) {
          const ArrayView& values = views.scalars[scalars[n]];
          if (k < values.shape()[0] && j < values.shape()[1]) values.copyRow(k, j, part, &out.scalars[n][at]);
        }
      }
  }
  void readPartOfRows(uint32_t number, const NodeBox& box, std::span<const uint32_t> scalars,
                      NodeArrays& out) const override {
    read(number, box, scalars, out);
  }
  uint64_t rowsInMemory(std::span<const uint32_t> /*scalars*/) const override { return 0; }

 private:
  GridDescription description_;
  std::vector<BlockViews> views_;  // [block]
};

class CallableSource : public GridSource {
 public:
  CallableSource(const std::vector<ArrayShape>& shapes, const ScalarNames& names, PythonRead read)
      : read_(std::move(read)) {
    description_.format = "a Python callable";
    description_.coordinate_bytes = 8;
    for (const ArrayShape& shape : shapes) {
      requireFewNodes(shape);
      description_.blocks.push_back(
          {fmt::format("block {}", description_.blocks.size() + 1), shape[2], shape[1], shape[0], true});
    }
    description_.scalars = describedScalars(names);
  }
  ~CallableSource() override {
    const py::gil_scoped_acquire locked;
    read_.function = py::object();
  }

  const GridDescription& description() const override { return description_; }

  /// Reads in pieces, since Python's arrays take as much memory as `out`.
  void read(uint32_t number, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    const uint64_t ni = description_.blocks[number].ni, end = box.endOfRow(ni);
    const WindowStrides strides(box, ni);
    const size_t nodes = strides.plane * (box.k1 - box.k0);
    for (std::vector<double>* axis : {&out.x, &out.y, &out.z}) axis->resize(nodes);
    out.blank.assign(nodes, 0);
    out.scalars.resize(scalars.size());
    for (std::vector<float>& values : out.scalars) values.resize(nodes);
    const uint64_t part = read_.parts_of_rows ? std::min(strides.row, kNodesAtATime) : strides.row;
    for (uint64_t i = box.i0; i < end; i += part) {
      const uint64_t i1 = std::min(i + part, end);
      for (NodeBox piece : cutForTasks(i1 - i, box, kNodesAtATime)) {
        piece.i0 = i;
        piece.i1 = i1;
        readPiece(number, piece, scalars, {strides, out});
      }
    }
  }
  void readPartOfRows(uint32_t number, const NodeBox& box, std::span<const uint32_t> scalars,
                      NodeArrays& out) const override {
    if (read_.parts_of_rows)
      read(number, box, scalars, out);
    else
      GridSource::readPartOfRows(number, box, scalars, out);
  }
  /// Python's arrays may be of double precision.
  uint64_t rowsInMemory(std::span<const uint32_t> /*scalars*/) const override {
    return read_.parts_of_rows ? 0 : 2;
  }

 private:
  static constexpr uint64_t kNodesAtATime = 1 << 18;

  struct Target {
    const WindowStrides& strides;
    NodeArrays& nodes;
  };

  void readPiece(uint32_t number, const NodeBox& piece, std::span<const uint32_t> scalars,
                 const Target& target) const {
    const py::gil_scoped_acquire locked;
    py::list wanted;
    for (const uint32_t scalar : scalars) wanted.append(description_.scalars[scalar].name);
    const py::object returned = read_.parts_of_rows
                                    ? read_.function(number, piece.k0, piece.k1, piece.j0, piece.j1, wanted,
                                                     py::arg("i0") = piece.i0, py::arg("i1") = piece.i1)
                                    : read_.function(number, piece.k0, piece.k1, piece.j0, piece.j1, wanted);
    if (!py::isinstance<py::tuple>(returned) && !py::isinstance<py::list>(returned))
      throw Error("read() returned {}; expected (x, y, z, [values], blank)", typeName(returned));
    const auto result = py::cast<py::tuple>(returned);
    if (result.size() != 5)
      throw Error("read() returned {} items; expected (x, y, z, [values], blank)", result.size());
    const Destination to{target.strides, piece};
    NodeArrays& out = target.nodes;
    to.copy(result[0], "x", out.x);
    to.copy(result[1], "y", out.y);
    to.copy(result[2], "z", out.z);
    if (!py::isinstance<py::iterable>(result[3]))
      throw Error("read(): values: {}; expected a list of arrays", typeName(result[3]));
    const auto values = py::cast<py::list>(result[3]);
    if (values.size() != scalars.size())
      throw Error("read() returned {} arrays of values; expected {}", values.size(), scalars.size());
    for (size_t n = 0; n < scalars.size(); ++n)
      to.copy(values[n], description_.scalars[scalars[n]].name, out.scalars[n]);
    if (!result[4].is_none()) to.copyBlank(result[4], out.blank);
  }

  static std::string typeName(const py::handle& object) {
    return py::str(object.get_type().attr("__name__"));
  }

  struct Destination {
    const WindowStrides& strides;
    const NodeBox& piece;

    void copyBlank(const py::handle& object, std::vector<uint8_t>& out) const {
      const auto array = py::cast<py::array>(object);
      if (!array.dtype().equal(py::dtype::of<bool>()))
        throw UsageError("read(): blank: its values are {}; expected bool, True where a node is not there",
                         std::string(py::str(py::handle(array.dtype()))));
      copy(array, "blank", out);
    }

    template <typename T>
    void copy(const py::handle& object, const std::string& what, std::vector<T>& out) const {
      const ArrayView view(py::cast<py::array>(object), "read(): " + what);
      const ArrayShape shape{piece.k1 - piece.k0, piece.j1 - piece.j0, piece.i1 - piece.i0};
      requireShape(view, shape, "read(): " + what);
      for (uint64_t k = 0; k < shape[0]; ++k)
        for (uint64_t j = 0; j < shape[1]; ++j)
          view.copyRow(k, j, {0, shape[2]}, &out[strides.at(piece.i0, piece.j0 + j, piece.k0 + k)]);
    }
  };

  GridDescription description_;
  PythonRead read_;
};

}  // namespace

std::unique_ptr<GridSource> sourceOfArrays(std::vector<BlockArrays> blocks, const ScalarNames& names,
                                           std::optional<double> time) {
  return std::make_unique<ArraySource>(std::move(blocks), names, time);
}

std::unique_ptr<GridSource> sourceOfCallable(const std::vector<std::array<uint64_t, 3>>& shapes,
                                             const ScalarNames& names, PythonRead read) {
  return std::make_unique<CallableSource>(shapes, names, std::move(read));
}

}  // namespace curvisplat::python
