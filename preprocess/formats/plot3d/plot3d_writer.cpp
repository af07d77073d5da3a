#include "preprocess/formats/plot3d/plot3d_writer.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/task_group.h>

#include <algorithm>
#include <bit>
#include <limits>
#include <numeric>
#include <optional>
#include <string>

#include "stream/base/disk_space.h"
#include "stream/base/durable_file.h"
#include "stream/base/error.h"
#include "stream/base/file.h"

namespace curvisplat {
namespace {

static_assert(std::endian::native == std::endian::little, "PLOT3D is written in the machine's byte order");

constexpr uint64_t kBatchNodes = 2 << 20;  // evaluated while the previous batch is written
constexpr uint64_t kTaskNodes = 32 << 10;  // what one worker reads from the source at a time

/// A file that has its name once it is complete.
class PendingFile {
 public:
  explicit PendingFile(const std::filesystem::path& path)
      : temporary_(writableTarget(path)),
        file_(temporary_.path(), Caching::kPages, OutputFile::Existing::kKeep, path) {}

  OutputFile& file() { return file_; }

  void putIntoPlace() {
    file_.close();
    temporary_.putIntoPlace();
  }

 private:
  TemporaryFile temporary_;
  OutputFile file_;
};

// The rows [begin, end) of a block (numbered j fastest) as arrays to write: x, y, z, iblank, scalars.
struct Batch {
  uint64_t begin = 0, end = 0;
  std::array<std::vector<float>, 3> coordinates;
  std::vector<int32_t> iblank;
  std::vector<std::vector<float>> scalars;
};

// The positions of a block's arrays in the two files.
struct BlockOffsets {
  uint64_t grid = 0, function = 0;
};

class Writer {
 public:
  /// `grid`: null: coordinates are not written.
  Writer(const GridSource& source, OutputFile* grid, OutputFile& function, Progress& progress)
      : source_(source),
        description_(source.description()),
        grid_(grid),
        function_(function),
        progress_(progress),
        wanted_(description_.scalars.size()) {
    std::iota(wanted_.begin(), wanted_.end(), 0u);
    for (const GridBlock& block : description_.blocks) has_blanking_ |= block.has_blanking;
  }

  void write() {
    const BlockOffsets sizes = writeHeaders();
    requireSpace(sizes);
    uint64_t nodes = 0;
    for (const GridBlock& block : description_.blocks) nodes += block.nodes();
    progress_.begin("write", nodes, "nodes");
    for (uint32_t b = 0; b < description_.blocks.size(); ++b) writeBlock(b);
    progress_.end();
  }

 private:
  uint64_t gridBytesPerNode() const { return has_blanking_ ? 16 : 12; }
  uint64_t functionBytesPerNode() const { return 4 * wanted_.size(); }

  // Writes the headers, records the positions of each block's arrays, and returns the sizes of the two files.
  BlockOffsets writeHeaders() {
    std::vector<int32_t> grid, function;
    if (description_.blocks.size() > 1) {
      grid.push_back(static_cast<int32_t>(description_.blocks.size()));
      function = grid;
    }
    for (const GridBlock& block : description_.blocks) {
      for (const uint64_t nodes : {block.ni, block.nj, block.nk}) {
        if (nodes > std::numeric_limits<int32_t>::max())
          throw Error("{}: {} has {} nodes along an axis; PLOT3D allows at most 2^31 - 1",
                      function_.path().string(), block.name, nodes);
        grid.push_back(static_cast<int32_t>(nodes));
        function.push_back(static_cast<int32_t>(nodes));
      }
      function.push_back(static_cast<int32_t>(wanted_.size()));
    }
    if (grid_) grid_->append(std::span<const int32_t>(grid));
    function_.append(std::span<const int32_t>(function));

    BlockOffsets next{grid_ ? grid_->size() : 0, function_.size()};
    for (const GridBlock& block : description_.blocks) {
      offsets_.push_back(next);
      next.grid += block.nodes() * gridBytesPerNode();
      next.function += block.nodes() * functionBytesPerNode();
    }
    return next;
  }

  void requireSpace(const BlockOffsets& sizes) const {
    const std::filesystem::path folder = std::filesystem::absolute(function_.path()).parent_path();
    const uint64_t needed = (grid_ ? sizes.grid : 0) + sizes.function;
    const std::optional<uint64_t> available = freeBytes(folder);
    if (available && *available < needed)
      throw Error("{}: needs {} bytes, but only {} are free; free some space or write elsewhere",
                  folder.string(), needed, *available);
  }

  void writeBlock(uint32_t b) {
    const GridBlock& block = description_.blocks[b];
    const uint64_t rows = block.nj * block.nk;
    const uint64_t batch_rows = std::max<uint64_t>(1, kBatchNodes / block.ni);
    Batch current, next;
    tbb::task_group evaluation;
    evaluate(b, 0, std::min(rows, batch_rows), current);
    while (current.begin < rows) {
      const uint64_t begin = current.end;
      if (begin < rows)
        evaluation.run([&, begin] { evaluate(b, begin, std::min(rows, begin + batch_rows), next); });
      try {
        writeBatch(b, current);
      } catch (...) {
        evaluation.wait();
        throw;
      }
      evaluation.wait();
      progress_.advance((current.end - current.begin) * block.ni);
      if (begin == rows) break;
      std::swap(current, next);
    }
  }

  void evaluate(uint32_t b, uint64_t begin, uint64_t end, Batch& out) {
    const GridBlock& block = description_.blocks[b];
    const uint64_t nodes = (end - begin) * block.ni;
    out.begin = begin;
    out.end = end;
    for (auto& axis : out.coordinates) axis.resize(nodes);
    out.iblank.resize(has_blanking_ ? nodes : 0);
    out.scalars.resize(wanted_.size());
    for (auto& values : out.scalars) values.resize(nodes);

    tbb::parallel_for(
        tbb::blocked_range<uint64_t>(begin, end, std::max<uint64_t>(1, kTaskNodes / block.ni)),
        [&](const tbb::blocked_range<uint64_t>& range) {
          for (uint64_t row = range.begin(); row < range.end();) {
            // A box does not extend beyond its plane.
            const uint64_t k = row / block.nj, j = row % block.nj;
            const uint64_t count = std::min(range.end() - row, block.nj - j);
            readBox(b, {j, j + count, k, k + 1}, (row - begin) * block.ni, out);
            row += count;
          }
        },
        tbb::simple_partitioner());
  }

  void readBox(uint32_t b, const NodeBox& box, uint64_t at, Batch& out) {
    NodeArrays& nodes = nodes_.local();
    source_.read(b, box, wanted_, nodes);
    const std::array<const std::vector<double>*, 3> axes{&nodes.x, &nodes.y, &nodes.z};
    for (size_t axis = 0; axis < 3; ++axis)
      std::transform(axes[axis]->begin(), axes[axis]->end(), out.coordinates[axis].begin() + at,
                     [](double x) { return static_cast<float>(x); });
    if (has_blanking_)
      std::transform(nodes.blank.begin(), nodes.blank.end(), out.iblank.begin() + at,
                     [](uint8_t blank) { return blank ? 0 : 1; });
    for (size_t n = 0; n < wanted_.size(); ++n)
      std::copy(nodes.scalars[n].begin(), nodes.scalars[n].end(), out.scalars[n].begin() + at);
  }

  void writeBatch(uint32_t b, const Batch& batch) {
    const GridBlock& block = description_.blocks[b];
    const uint64_t array_bytes = block.nodes() * 4, begin = batch.begin * block.ni * 4;
    const auto put = [&](OutputFile& file, uint64_t block_offset, size_t array, const auto& values) {
      file.writeAt(block_offset + array * array_bytes + begin, std::as_bytes(std::span(values)));
    };
    if (grid_) {
      for (size_t axis = 0; axis < 3; ++axis) put(*grid_, offsets_[b].grid, axis, batch.coordinates[axis]);
      if (has_blanking_) put(*grid_, offsets_[b].grid, 3, batch.iblank);
    }
    for (size_t n = 0; n < batch.scalars.size(); ++n)
      put(function_, offsets_[b].function, n, batch.scalars[n]);
  }

  const GridSource& source_;
  const GridDescription& description_;
  OutputFile* const grid_;
  OutputFile& function_;
  Progress& progress_;
  std::vector<uint32_t> wanted_;
  bool has_blanking_ = false;
  std::vector<BlockOffsets> offsets_;
  tbb::enumerable_thread_specific<NodeArrays> nodes_;
};

std::filesystem::path withEnding(const std::filesystem::path& prefix, const char* ending) {
  return std::filesystem::path(prefix) += ending;
}

}  // namespace

Plot3dOutputs plot3dOutputs(const std::filesystem::path& prefix) {
  return {withEnding(prefix, ".xyz"), withEnding(prefix, ".fun"), withEnding(prefix, ".nam")};
}

void writePlot3d(const GridSource& source, const Plot3dOutputs& outputs, Progress& progress) {
  std::optional<PendingFile> grid;
  if (!outputs.grid.empty()) grid.emplace(outputs.grid);
  PendingFile function(outputs.function), names(outputs.names);
  Writer(source, grid ? &grid->file() : nullptr, function.file(), progress).write();
  std::string text;
  for (const GridScalar& scalar : source.description().scalars) text += scalar.name + "\n";
  names.file().append(std::as_bytes(std::span(text)));

  if (grid) grid->putIntoPlace();
  function.putIntoPlace();
  names.putIntoPlace();
}

Plot3dOutputs writePlot3d(const GridSource& source, const std::filesystem::path& prefix, Progress& progress) {
  Plot3dOutputs outputs = plot3dOutputs(prefix);
  writePlot3d(source, outputs, progress);
  return outputs;
}

}  // namespace curvisplat
