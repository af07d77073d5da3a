// Conversion, and the addition of a scalar and of a time step, on a disk that fails at every call they make:
// they say so in a line, or have done their work. What is there afterwards is whole or no cache, and nothing
// else is left. The grids are structured ones, and an unstructured one of mixed cells, also with so little
// memory that positions, sums and faces wait on disk in files without a name.
#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <glm/vec3.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "stream/cache/cache_reader.h"
#include "tests/faults/small_conversion.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;
using faults::Fault;
using faults::FaultOutcome;
using faults::kFaults;

TEST_F(ConversionSweep, AConversionIsWholeOrNothing) {
  setUp(twoBlocks(7));
  for (const Fault& fault : kFaults) {
    EXPECT_GE(converting({}).run(fault), 4) << fault.name;
    if (HasFailure()) return;
  }
}

TEST_F(ConversionSweep, AnOldCacheIsReplacedOrAsItWas) {
  setUp(twoBlocks(7));
  faults::FaultSweep sweep = converting({true, false});
  sweep.prepare = [this] { startWithOne(); };
  sweep.check = [this](const FaultOutcome& outcome) {
    expectNoneWrong();
    const Files files = filesOf(output_);
    const bool is_done = holdsAllOf(files, both_);
    EXPECT_TRUE(is_done || (!outcome.error.empty() && holdsAllOf(files, one_))) << outcome.error;
    if (!outcome.has_refused_removal) expectOnly(outcome.error.empty() ? both_ : one_);
  };
  for (const Fault& fault : {faults::kFailsOnce, faults::kFailsToSync, faults::kFailsToRename}) {
    sweep.run(fault);
    if (HasFailure()) return;
  }
}

TEST_F(ConversionSweep, AnAdditionIsThereOrNot) {
  setUp(twoBlocks(7));
  for (const Fault& fault : kFaults) {
    EXPECT_GE(adding().run(fault), 2) << fault.name;
    if (HasFailure()) return;
  }
}

TEST_F(ConversionSweep, AStepIsThereOrNot) {
  setUp(twoBlocks(7));
  expectStepsThereOrNot(kFaults);
}

/// A text goes through a temporary file.
TEST_F(ConversionSweep, ATextIsConvertedOrNot) {
  const FunctionGridSource grid = twoBlocks(6);
  std::string text = "2\n6 6 6 6 6 6\n";
  for (uint32_t block = 0; block < 2; ++block) {
    NodeArrays nodes;
    grid.read(block, {0, 6, 0, 6}, {}, nodes);
    for (const auto* axis : {&nodes.x, &nodes.y, &nodes.z})
      for (const double number : *axis) text += fmt::format("{}\n", number);
  }
  grid_ = input_ / "text.xyz";
  writeFileAtomically(grid_, text);
  setUp(grid);
  for (const Fault& fault : {faults::kFailsOnce, faults::kIsFull, faults::kIsCutOff}) {
    converting({}).run(fault);
    if (HasFailure()) return;
  }
}

/// Several buckets, and levels.
TEST_F(ConversionSweep, ALargerOneIsWholeOrNothing) {
  setUp(twoBlocks(33));
  writeFiles(output_, both_);
  ASSERT_GT(CacheReader(output_).manifest().levels, 1u);
  faults::FaultSweep conversion = converting({}), addition = adding();
  conversion.stride = addition.stride = 463;
  EXPECT_GE(conversion.run(faults::kFailsOnce), 7);
  if (HasFailure() || !faults::isWholeSweep()) return;  // usually AnAdditionIsThereOrNot alone has additions
  EXPECT_GE(addition.run(faults::kFailsOnce), 7);
}

TEST_F(ConversionSweep, ShortInterruptedAndSlowTransfersChangeNothing) {
  setUp(twoBlocks(7));
  for (const bool is_slow : {false, true}) {
    startAnew();
    faults::FaultySystemCalls faulty;
    faulty.is_unsynced = true;
    faulty.is_slow = is_slow;
    faulty.largest_transfer = 777;
    faulty.interrupt_every = 3;
    const ScopedSystemCalls scope(faulty);
    convertNow({0}, {});
    expectOnly(one_);
    addNow();
    expectOnly(added_);
  }
}

/// A .vtu file of cubes in a curved slab: hexahedra, pairs of wedges and pyramids around a point of their own, by turns. Two scalars
/// and a velocity at points, and two scalars in cells.
class MixedCells {
 public:
  explicit MixedCells(uint64_t side) {
    const auto number = [&](uint64_t i, uint64_t j, uint64_t k) {
      return i + (side + 1) * (j + (side + 1) * k);
    };
    for (uint64_t k = 0; k <= side; ++k)
      for (uint64_t j = 0; j <= side; ++j)
        for (uint64_t i = 0; i <= side; ++i)
          points_.push_back(glm::dvec3(i, j, k) / static_cast<double>(side));
    for (uint64_t k = 0; k < side; ++k)
      for (uint64_t j = 0; j < side; ++j)
        for (uint64_t i = 0; i < side; ++i)
          addCube({number(i, j, k), number(i + 1, j, k), number(i + 1, j + 1, k), number(i, j + 1, k),
                   number(i, j, k + 1), number(i + 1, j, k + 1), number(i + 1, j + 1, k + 1),
                   number(i, j + 1, k + 1)});
    for (glm::dvec3& point : points_) {
      const double r = 1 + point.y;
      point = {r * std::cos(point.x), r * std::sin(point.x), point.z + 0.1 * std::sin(3 * point.x)};
    }
  }

  std::string file() {
    std::vector<double> f, g, c, d;
    std::vector<glm::dvec3> velocity;
    for (const glm::dvec3& point : points_) {
      f.push_back(point.x * point.y);
      g.push_back(std::sin(5 * point.z));
      velocity.emplace_back(-point.y, point.x * point.z, point.x);
    }
    for (size_t cell = 0; cell < types_.size(); ++cell) {
      c.push_back(std::cos(0.1 * static_cast<double>(cell)));
      d.push_back(static_cast<double>(cell % 17));
    }
    std::string text = fmt::format(
        "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" "
        "header_type=\"UInt64\">\n"
        "<UnstructuredGrid>\n<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n<PointData>\n",
        points_.size(), types_.size());
    text += array("f", "Float64", f) + array("g", "Float64", g) + array("velocity", "Float64", velocity, 3) +
            "</PointData>\n<CellData>\n";
    text += array("c", "Float64", c) + array("d", "Float64", d) + "</CellData>\n<Points>\n";
    text += array("p", "Float64", points_, 3) + "</Points>\n<Cells>\n";
    text += array("connectivity", "Int64", corners_) + array("offsets", "Int64", ends_) +
            array("types", "UInt8", types_) + "</Cells>\n</Piece>\n</UnstructuredGrid>\n";
    return text + "<AppendedData encoding=\"raw\">\n_" + appended_ + "\n</AppendedData>\n</VTKFile>\n";
  }

 private:
  using Corners = std::vector<uint64_t>;

  void addCube(const Corners& c) {
    switch (cube_++ % 3) {
      case 0:
        return add(12, c);
      case 1:
        add(13, {c[0], c[1], c[2], c[4], c[5], c[6]});
        return add(13, {c[0], c[2], c[3], c[4], c[6], c[7]});
      default: {
        glm::dvec3 middle(0.0);
        for (const uint64_t corner : c) middle += points_[corner] / 8.0;
        const uint64_t apex = points_.size();
        points_.push_back(middle);
        for (const Corners& f :
             {Corners{0, 1, 2, 3}, {4, 7, 6, 5}, {0, 4, 5, 1}, {1, 5, 6, 2}, {2, 6, 7, 3}, {3, 7, 4, 0}})
          add(14, {c[f[0]], c[f[1]], c[f[2]], c[f[3]], apex});
      }
    }
  }
  void add(uint8_t type, const Corners& corners) {
    types_.push_back(type);
    corners_.insert(corners_.end(), corners.begin(), corners.end());
    ends_.push_back(corners_.size());
  }
  template <typename T>
  std::string array(const char* name, const char* type, const std::vector<T>& values, int components = 1) {
    const size_t offset = appended_.size();
    const uint64_t bytes = values.size() * sizeof(T);
    appended_.append(reinterpret_cast<const char*>(&bytes), sizeof bytes);
    appended_.append(reinterpret_cast<const char*>(values.data()), bytes);
    return fmt::format(
        "<DataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\" format=\"appended\" offset=\"{}\"/>\n",
        type, name, components, offset);
  }

  uint64_t cube_ = 0;
  std::vector<glm::dvec3> points_;
  std::vector<uint64_t> corners_, ends_;
  std::vector<uint8_t> types_;
  std::string appended_;
};

/// Counts the files without a name, each of which is made as curvisplat.*.tmp.
class CountingNamelessFiles : public SystemCalls {
 public:
  int64_t files = 0;
  int open(const char* path, int flags, unsigned mode) override {
    const std::string name = std::filesystem::path(path).filename();
    files += (flags & O_EXCL) != 0 && name.starts_with("curvisplat.") && name.ends_with(".tmp");
    return SystemCalls::open(path, flags, mode);
  }
  int fsync(int) override { return 0; }
};

class MeshSweep : public ConversionSweep {
 protected:
  MeshSweep() {
    grid_ = input_ / "in.vtu";
    writeFileAtomically(grid_, MixedCells(4).file());
    inputs_ = filesOf(input_.path());
  }
  /// Sets up an addition of this scalar and the next one.
  void setUpFrom(const std::string& name) {
    startAnew();
    const std::vector<GridScalar> scalars = open()->description().scalars;
    const auto found = std::ranges::find(scalars, name, &GridScalar::name);
    ASSERT_LT(found - scalars.begin() + 1, std::ssize(scalars)) << name;
    first_ = static_cast<uint32_t>(found - scalars.begin());
    setUp();
  }
  int64_t namelessFiles() const {
    startAnew();
    CountingNamelessFiles counting;
    const ScopedSystemCalls scope(counting);
    convertNow({first_, first_ + 1}, {});
    return counting.files;
  }
};

TEST_F(MeshSweep, AConversionIsWholeOrNothing) {
  for (const int job : {0, 1}) {
    setUpFrom(job == 0 ? "f" : "c");
    ASSERT_EQ(namelessFiles(), 0);
    for (size_t n = 0; n < std::size(kFaults); ++n) {
      if (!isTriedWith(job, n)) continue;
      EXPECT_GE(converting({}).run(kFaults[n]), 4) << job << ": " << kFaults[n].name;
      if (HasFailure()) return;
    }
  }
}

/// Positions, sums of points, and faces of cells that wait for the cell on their other side.
TEST_F(MeshSweep, WhatWaitsOnDiskIsWholeOrNothing) {
  mesh_bytes_ = 100'000;
  for (const int job : {0, 1}) {
    setUpFrom(job == 0 ? "f" : "c");
    ASSERT_GE(namelessFiles(), job == 0 ? 5 : 7);
    const Fault tried[] = {faults::kFailsOnce, faults::kFailsFromThenOn, faults::kHasNoNames,
                           faults::kIsFull};
    for (size_t n = 0; n < std::size(tried); ++n) {
      if (!isTriedWith(job, n)) continue;
      EXPECT_GE(converting({}).run(tried[n]), 7) << job << ": " << tried[n].name;
      if (HasFailure()) return;
    }
  }
}

/// A quantity that needs gradients is computed before the conversion, and stays in a file.
TEST_F(MeshSweep, GradientsAreWholeOrNothing) {
  with_gradients_ = true;
  setUpFrom("vorticity_magnitude");
  ASSERT_GE(namelessFiles(), 2);
  for (const Fault& fault : {faults::kFailsOnce, faults::kIsFull}) {
    EXPECT_GE(converting({}).run(fault), 7) << fault.name;
    if (HasFailure()) return;
  }
}

TEST_F(MeshSweep, AnAdditionIsThereOrNot) {
  for (const int job : {0, 1}) {
    setUpFrom(job == 0 ? "f" : "c");
    for (size_t n = 0; n < std::size(kFaults); ++n) {
      if (!isTriedWith(job, n)) continue;
      EXPECT_GE(adding().run(kFaults[n]), 2) << job << ": " << kFaults[n].name;
      if (HasFailure()) return;
    }
  }
}

TEST_F(MeshSweep, AStepIsThereOrNot) {
  setUpFrom("c");
  expectStepsThereOrNot(std::array{faults::kFailsOnce, faults::kIsFull, faults::kFailsToSync});
}

}  // namespace
}  // namespace curvisplat
