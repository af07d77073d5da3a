#include "preprocess/gather/cell_slopes.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstring>
#include <limits>

#include "preprocess/gather/streams_file.h"

namespace curvisplat {
namespace {

constexpr size_t kCellsPerTask = 256, kRecordsPerTask = 16384;

struct BodyRecord {
  uint64_t cell;
  CellBody body;  // values follow
};

struct FaceRecord {
  std::array<uint64_t, 3> corners;  // the lowest, rising
  uint64_t cell;
  glm::dvec3 centre;  // of the cell; values follow
};

struct NeighbourRecord {
  uint64_t cell, neighbour;
  glm::dvec3 centre;  // of the neighbour; values follow
};

uint64_t hashOf(const std::array<uint64_t, 3>& corners) {
  uint64_t hash = 0;
  for (const uint64_t corner : corners) {
    hash ^= corner;
    hash *= 0x9e3779b97f4a7c15;
    hash ^= hash >> 29;
  }
  return hash;
}

/// Records of one size, with values behind each.
template <typename Record>
class RecordArray {
 public:
  explicit RecordArray(size_t fields) : stride_(sizeof(Record) + fields * sizeof(float)) {}

  void load(const StreamsFile& file, size_t stream) {
    bytes_.resize(file.bytes(stream));
    size_t at = 0;
    file.forEach(stream, [&](std::span<const std::byte> records) {
      std::memcpy(bytes_.data() + at, records.data(), records.size());
      at += records.size();
    });
  }
  size_t size() const { return bytes_.size() / stride_; }
  Record operator[](size_t n) const {
    Record record;
    std::memcpy(static_cast<void*>(&record), bytes_.data() + n * stride_, sizeof record);
    return record;
  }
  void values(size_t n, std::span<float> out) const {
    std::memcpy(out.data(), bytes_.data() + n * stride_ + sizeof(Record), out.size_bytes());
  }

 private:
  size_t stride_;
  std::vector<std::byte> bytes_;
};

template <typename Record>
void put(std::byte* to, const Record& record, std::span<const float> values) {
  std::memcpy(to, &record, sizeof record);
  std::memcpy(to + sizeof record, values.data(), values.size_bytes());
}

}  // namespace

CellSlopes::CellSlopes(uint64_t cells, size_t fields, uint64_t memory_bytes, std::filesystem::path folder)
    : cells_(cells), fields_(fields), memory_bytes_(memory_bytes), folder_(std::move(folder)) {
  // A cell with about six faces, each of which two cells have.
  constexpr uint64_t kUsualFaces = 6;
  const uint64_t value_bytes = fields * sizeof(float);
  const uint64_t face_bytes = kUsualFaces * (sizeof(FaceRecord) + value_bytes + 2 * sizeof(uint64_t));
  const uint64_t range_bytes = sizeof(BodyRecord) + value_bytes +
                               kUsualFaces * (sizeof(NeighbourRecord) + value_bytes + 3 * sizeof(uint64_t));
  // Places in a range are of 32 bits.
  range_cells_ = std::clamp<uint64_t>(memory_bytes / 2 / range_bytes, 1, uint64_t{1} << 26);
  const uint64_t ranges = std::max<uint64_t>(1, (cells + range_cells_ - 1) / range_cells_);
  const uint64_t face_streams = cells * face_bytes / std::max<uint64_t>(1, memory_bytes / 4) + 1;
  bodies_ = std::make_unique<StreamsFile>(folder_, ranges, memory_bytes / 8);
  faces_ = std::make_unique<StreamsFile>(
      folder_, std::min<uint64_t>(face_streams, StreamsFile::mostStreams(memory_bytes / 8)),
      memory_bytes / 8);
}

CellSlopes::~CellSlopes() = default;

void CellSlopes::add(const GatheredCells& cells) {
  std::vector<CellBody> bodies(cells.size());
  tbb::parallel_for(tbb::blocked_range<size_t>(0, cells.size(), kCellsPerTask),
                    [&](const tbb::blocked_range<size_t>& part) {
                      for (size_t n = part.begin(); n < part.end(); ++n)
                        if (cells.shapes[n] != CellKind::kNone) bodies[n] = bodyOf(cells.view(n, 0));
                    });
  std::vector<std::byte> body_record(sizeof(BodyRecord) + fields_ * sizeof(float));
  std::vector<std::byte> face_record(sizeof(FaceRecord) + fields_ * sizeof(float));
  std::vector<uint64_t> of_face;
  for (size_t n = 0; n < cells.size(); ++n) {
    if (cells.shapes[n] == CellKind::kNone) continue;
    const std::span<const float> values = std::span(cells.cell_values).subspan(n * fields_, fields_);
    put(body_record.data(), BodyRecord{cells.numbers[n], bodies[n]}, values);
    bodies_->append(cells.numbers[n] / range_cells_, body_record);

    const std::span<const uint64_t> corners = cells.cornersOfCell(n);
    const std::span<const uint32_t> faces = facesOf(cells.shapes[n], cells.view(n, 0).faces);
    for (size_t at = 0; at < faces.size(); at += faces[at] + size_t{1}) {
      of_face.clear();
      for (const uint32_t corner : faces.subspan(at + 1, faces[at])) of_face.push_back(corners[corner]);
      std::sort(of_face.begin(), of_face.end());
      of_face.erase(std::unique(of_face.begin(), of_face.end()), of_face.end());
      if (of_face.size() < 3) continue;  // collapsed
      const FaceRecord face{{of_face[0], of_face[1], of_face[2]}, cells.numbers[n], bodies[n].centre};
      put(face_record.data(), face, values);
      faces_->append(faces_->streams() > 1 ? hashOf(face.corners) % faces_->streams() : 0, face_record);
    }
  }
}

void CellSlopes::matchFaces(size_t stream, StreamsFile& neighbours) {
  RecordArray<FaceRecord> faces(fields_);
  faces.load(*faces_, stream);
  faces_->forget(stream);
  // Records of a stream are in the order of the cells.
  struct Key {
    uint64_t hash;
    size_t record;
    bool operator<(const Key& other) const {
      return hash != other.hash ? hash < other.hash : record < other.record;
    }
  };
  std::vector<Key> keys(faces.size());
  tbb::parallel_for(tbb::blocked_range<size_t>(0, keys.size(), kRecordsPerTask),
                    [&](const tbb::blocked_range<size_t>& part) {
                      for (size_t n = part.begin(); n < part.end(); ++n)
                        keys[n] = {hashOf(faces[n].corners), n};
                    });
  tbb::parallel_sort(keys.begin(), keys.end());
  std::vector<float> values(fields_);
  std::vector<std::byte> record(sizeof(NeighbourRecord) + fields_ * sizeof(float));
  const auto tell = [&](const FaceRecord& to, const FaceRecord& of, size_t of_record) {
    faces.values(of_record, values);
    put(record.data(), NeighbourRecord{to.cell, of.cell, of.centre}, values);
    neighbours.append(to.cell / range_cells_, record);
  };
  const auto join = [&](size_t first, size_t second) {
    const FaceRecord a = faces[first], b = faces[second];
    if (a.cell == b.cell) return;
    tell(a, b, second);
    tell(b, a, first);
  };
  std::vector<std::pair<std::array<uint64_t, 3>, size_t>> same_hash;
  for (size_t first = 0; first < keys.size();) {
    size_t end = first + 1;
    while (end < keys.size() && keys[end].hash == keys[first].hash) ++end;
    // Other faces may have the same hash.
    same_hash.clear();
    for (size_t n = first; n < end && end - first > 1; ++n)
      same_hash.emplace_back(faces[keys[n].record].corners, keys[n].record);
    if (same_hash.size() > 2) std::sort(same_hash.begin(), same_hash.end());
    for (size_t n = 0; n < same_hash.size();) {
      size_t alike = n + 1;
      while (alike < same_hash.size() && same_hash[alike].first == same_hash[n].first) ++alike;
      if (alike - n == 2) join(same_hash[n].second, same_hash[n + 1].second);
      n = alike;
    }
    first = end;
  }
}

void CellSlopes::makeSplats(size_t range, const StreamsFile& neighbours, const TakeSplat& take,
                            PointSums::Counts& counts) const {
  RecordArray<BodyRecord> bodies(fields_);
  RecordArray<NeighbourRecord> beside(fields_);
  bodies.load(*bodies_, range);
  beside.load(neighbours, range);
  // Neighbours by cell, in the order of their numbers: `begins` of each cell, among `sorted` records.
  const uint64_t first_cell = range * range_cells_;
  std::vector<uint32_t> begins(std::min(range_cells_, cells_ - first_cell) + 1, 0);
  for (size_t n = 0; n < beside.size(); ++n) ++begins[beside[n].cell - first_cell + 1];
  for (size_t n = 1; n < begins.size(); ++n) begins[n] += begins[n - 1];
  std::vector<uint32_t> sorted(beside.size());
  {
    std::vector<uint32_t> next(begins.begin(), begins.end() - 1);
    for (size_t n = 0; n < sorted.size(); ++n)
      sorted[next[beside[n].cell - first_cell]++] = static_cast<uint32_t>(n);
  }
  std::atomic<uint64_t> splats = 0, degenerate = 0;
  tbb::parallel_for(
      tbb::blocked_range<size_t>(0, bodies.size(), 1024), [&](const tbb::blocked_range<size_t>& part) {
        NodeSplat splat;
        std::vector<SplatScalar> values(fields_);
        std::vector<float> own(fields_), others;
        std::vector<glm::dvec3> steps;
        uint64_t made = 0, flat = 0;
        for (size_t n = part.begin(); n < part.end(); ++n) {
          const BodyRecord body = bodies[n];
          bodies.values(n, own);
          steps.clear();
          others.clear();
          const auto of_cell =
              std::span(sorted).subspan(begins[body.cell - first_cell],
                                        begins[body.cell - first_cell + 1] - begins[body.cell - first_cell]);
          std::sort(of_cell.begin(), of_cell.end(), [&](uint32_t a, uint32_t b) {
            const uint64_t cell_a = beside[a].neighbour, cell_b = beside[b].neighbour;
            return cell_a != cell_b ? cell_a < cell_b : a < b;
          });
          for (const uint32_t neighbour : of_cell) {
            others.resize(others.size() + fields_);
            beside.values(neighbour, std::span(others).last(fields_));
            steps.push_back(beside[neighbour].centre - body.body.centre);
          }
          if (!(body.body.volume > 0)) ++flat;
          splatOfCell(body.cell, body.body, own, {steps, others}, splat, values);
          take(splat, values);
          ++made;
        }
        splats += made;
        degenerate += flat;
      });
  counts.splats += splats;
  counts.degenerate += degenerate;
}

PointSums::Counts CellSlopes::finish(const TakeSplat& take, const Progress& progress) {
  bodies_->close();
  faces_->close();
  StreamsFile neighbours(folder_, bodies_->streams(), memory_bytes_ / 8);
  for (size_t stream = 0; stream < faces_->streams(); ++stream) {
    progress.throwIfStopped();
    matchFaces(stream, neighbours);
  }
  neighbours.close();
  PointSums::Counts counts;
  for (size_t range = 0; range < bodies_->streams(); ++range) {
    progress.throwIfStopped();
    makeSplats(range, neighbours, take, counts);
    bodies_->forget(range);
    neighbours.forget(range);
  }
  return counts;
}

}  // namespace curvisplat
