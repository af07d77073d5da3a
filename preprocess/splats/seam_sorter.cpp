#include "preprocess/splats/seam_sorter.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <queue>
#include <type_traits>
#include <utility>

#include "stream/base/check.h"

namespace curvisplat {
namespace {

// A record: along, across, node, flags, growth code, the splat's 10 numbers, node position, spacing, lines; 5 numbers a
// variable.
constexpr size_t kLinesSize = (sizeof(NodeSplat::lines) + sizeof(double) - 1) / sizeof(double);
constexpr size_t kNodeSize = 19 + kLinesSize;
static_assert(std::is_trivially_copyable_v<decltype(NodeSplat::lines)>);
constexpr size_t kScalarSize = 5;
constexpr uint64_t kRegular = 1, kOnBlockFace = 2, kBehindFace = 4, kProbe = 8;  // of the flags
constexpr int kLayersShift = 8, kBorderCodeShift = 32;

constexpr size_t kWriteSize = 32 << 10;  // doubles

/// Reads a run from the file, a buffer of whole records at a time.
class RunReader {
 public:
  RunReader(const InputFile& file, uint64_t begin, uint64_t end, size_t record_size, size_t buffer_records)
      : file_(&file),
        next_(begin),
        end_(end),
        record_size_(record_size),
        buffer_(buffer_records * record_size) {
    fill();
  }

  bool done() const { return filled_ == 0; }
  const double* record() const { return buffer_.data() + at_; }
  void advance() {
    at_ += record_size_;
    if (at_ == filled_) fill();
  }

 private:
  void fill() {
    at_ = 0;
    filled_ = static_cast<size_t>(std::min<uint64_t>(buffer_.size(), (end_ - next_) / sizeof(double)));
    file_->readAt(next_, std::span(buffer_).first(filled_));
    next_ += filled_ * sizeof(double);
  }

  const InputFile* file_;
  uint64_t next_, end_;  // bytes of the file
  size_t record_size_;
  std::vector<double> buffer_;
  size_t at_ = 0, filled_ = 0;
};

}  // namespace

SeamSorter::SeamSorter(size_t variables, uint64_t memory_bytes, std::filesystem::path temporary_folder)
    : variables_(variables),
      record_size_(recordBytes(variables) / sizeof(double)),
      memory_bytes_(memory_bytes),
      capacity_(std::max<uint64_t>(1, memory_bytes / (recordBytes(variables) + sizeof(Entry)))),
      folder_(std::move(temporary_folder)) {}

size_t SeamSorter::recordBytes(size_t variables) {
  return (kNodeSize + variables * kScalarSize) * sizeof(double);
}

void SeamSorter::add(const SeamNode& node, std::span<const SplatScalar> values) {
  CURVISPLAT_CHECK_OP(values.size(), ==, variables_);
  if (entries_.size() == capacity_) spill();
  if (entries_.empty()) {
    // All at once: growing would hold the old and the new. Pages that are never touched cost nothing.
    entries_.reserve(capacity_);
    records_.reserve(capacity_ * record_size_);
  }
  entries_.push_back({node.along, node.splat.node, entries_.size()});
  pack(node, values, records_);
}

void SeamSorter::pack(const SeamNode& node, std::span<const SplatScalar> values, std::vector<double>& out) {
  const auto put = [&](auto... numbers) { (out.push_back(numbers), ...); };
  const NodeSplat& n = node.splat;
  const Splat& s = n.splat;
  const uint64_t flags = (n.regular ? kRegular : 0) | (n.on_block_face ? kOnBlockFace : 0) |
                         (n.behind_face ? kBehindFace : 0) | (n.is_probe ? kProbe : 0) |
                         uint64_t{n.layers} << kLayersShift | uint64_t{n.border_code} << kBorderCodeShift;
  put(node.along, node.across, std::bit_cast<double>(n.node), std::bit_cast<double>(flags),
      std::bit_cast<double>(uint64_t{n.growth_code}));
  put(s.position.x, s.position.y, s.position.z, s.axis[0], s.axis[1], s.axis[2]);
  put(s.shear[0], s.shear[1], s.shear[2], s.weight);
  put(n.node_position.x, n.node_position.y, n.node_position.z, n.spacing);
  std::array<double, kLinesSize> lines{};
  std::memcpy(lines.data(), n.lines.data(), sizeof(n.lines));
  out.insert(out.end(), lines.begin(), lines.end());
  for (const SplatScalar& v : values) put(v.mean, v.slope.x, v.slope.y, v.slope.z, v.variance);
}

void SeamSorter::unpack(const double* record, SeamNode& node, std::span<SplatScalar> values) const {
  const auto get = [&] { return *record++; };
  const auto get_vector = [&] {
    record += 3;
    return glm::dvec3(record[-3], record[-2], record[-1]);
  };
  node.along = get();
  node.across = get();
  NodeSplat& n = node.splat;
  n.node = std::bit_cast<uint64_t>(get());
  const auto flags = std::bit_cast<uint64_t>(get());
  n.regular = (flags & kRegular) != 0;
  n.on_block_face = (flags & kOnBlockFace) != 0;
  n.behind_face = (flags & kBehindFace) != 0;
  n.is_probe = (flags & kProbe) != 0;
  n.layers = static_cast<uint8_t>(flags >> kLayersShift);
  n.border_code = static_cast<uint32_t>(flags >> kBorderCodeShift);
  n.growth_code = static_cast<uint32_t>(std::bit_cast<uint64_t>(get()));
  n.splat.position = get_vector();
  for (double& axis : n.splat.axis) axis = get();
  for (double& shear : n.splat.shear) shear = get();
  n.splat.weight = get();
  n.node_position = get_vector();
  n.spacing = get();
  std::memcpy(static_cast<void*>(n.lines.data()), record, sizeof(n.lines));
  record += kLinesSize;
  for (SplatScalar& value : values) {
    value.mean = get();
    value.slope = get_vector();
    value.variance = get();
  }
}

void SeamSorter::drainPacked(const std::function<void(std::span<const double>)>& visit) {
  std::vector<double> record;
  drain([&](const SeamNode& node, std::span<const SplatScalar> values) {
    record.clear();
    pack(node, values, record);
    visit(record);
  });
}

void SeamSorter::addPacked(std::span<const double> records) {
  SeamNode node;
  std::vector<SplatScalar> values(variables_);
  for (size_t at = 0; at + record_size_ <= records.size(); at += record_size_) {
    unpack(&records[at], node, values);
    add(node, values);
  }
}

void SeamSorter::spill() {
  if (!file_) file_ = std::make_unique<NamelessFile>(folder_);
  OutputFile& out = file_->out();
  std::sort(entries_.begin(), entries_.end());
  const uint64_t begin = out.size();
  std::vector<double> block;
  for (const Entry& entry : entries_) {
    const double* record = records_.data() + entry.record * record_size_;
    block.insert(block.end(), record, record + record_size_);
    if (block.size() < kWriteSize) continue;
    out.append(std::span<const double>(block));
    block.clear();
  }
  out.append(std::span<const double>(block));
  runs_.push_back({begin, out.size()});
  entries_.clear();
  records_.clear();
}

void SeamSorter::drain(const Visit& visit) {
  if (!runs_.empty()) return drainRuns(visit);
  std::sort(entries_.begin(), entries_.end());
  SeamNode node;
  std::vector<SplatScalar> values(variables_);
  for (const Entry& entry : entries_) {
    unpack(records_.data() + entry.record * record_size_, node, values);
    visit(node, values);
  }
  entries_ = std::vector<Entry>();
  records_ = std::vector<double>();
}

void SeamSorter::drainRuns(const Visit& visit) {
  if (!entries_.empty()) spill();
  entries_ = std::vector<Entry>();
  records_ = std::vector<double>();

  const size_t buffer_records =
      std::max<uint64_t>(1, memory_bytes_ / runs_.size() / (record_size_ * sizeof(double)));
  std::vector<RunReader> readers;
  for (const Run& run : runs_)
    readers.emplace_back(file_->in(), run.begin, run.end, record_size_, buffer_records);

  SeamNode node;
  std::vector<SplatScalar> values(variables_);
  const auto later = [](const Entry& a, const Entry& b) { return b < a; };
  std::priority_queue<Entry, std::vector<Entry>, decltype(later)> heads(later);
  const auto push_head = [&](size_t run) {
    if (readers[run].done()) return;
    unpack(readers[run].record(), node, values);
    heads.push({node.along, node.splat.node, run});
  };
  for (size_t run = 0; run < readers.size(); ++run) push_head(run);
  while (!heads.empty()) {
    const size_t run = heads.top().record;
    heads.pop();
    unpack(readers[run].record(), node, values);
    visit(node, values);
    readers[run].advance();
    push_head(run);
  }
  runs_.clear();
  file_.reset();
}

}  // namespace curvisplat
