#include "preprocess/seams/seam_sorter.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <type_traits>
#include <utility>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

// A record: along, across, node, flags, growth code, the splat's 10 numbers, node position, spacing, lines;
// 5 numbers a variable.
constexpr size_t kLinesSize = (sizeof(NodeSplat::lines) + sizeof(double) - 1) / sizeof(double);
constexpr size_t kNodePosition = 15;
constexpr size_t kNodeSize = kNodePosition + 4 + kLinesSize;
static_assert(std::is_trivially_copyable_v<decltype(NodeSplat::lines)>);
constexpr size_t kScalarSize = 5;
constexpr uint64_t kRegular = 1, kOnBlockFace = 2, kBehindFace = 4, kProbe = 8, kGentle = 16,
                   kFitsLayers = 32;  // of the flags
constexpr int kLayersShift = 8, kBorderCodeShift = 32;

/// `record`: behind its first three numbers.
void packRest(const NodeSplat& n, std::span<const SplatScalar> values, double* record) {
  const auto put = [&](auto... numbers) { ((*record++ = numbers), ...); };
  const Splat& s = n.splat;
  const uint64_t flags = (n.regular ? kRegular : 0) | (n.on_block_face ? kOnBlockFace : 0) |
                         (n.behind_face ? kBehindFace : 0) | (n.is_probe ? kProbe : 0) |
                         (n.fit == StretchFit::kGentle ? kGentle : 0) | (n.fits_layers ? kFitsLayers : 0) |
                         uint64_t{n.layers} << kLayersShift | uint64_t{n.border_code} << kBorderCodeShift;
  put(std::bit_cast<double>(flags), std::bit_cast<double>(uint64_t{n.growth_code}));
  put(s.position.x, s.position.y, s.position.z, s.axis[0], s.axis[1], s.axis[2]);
  put(s.shear[0], s.shear[1], s.shear[2], s.weight);
  put(n.node_position.x, n.node_position.y, n.node_position.z, n.spacing);
  record[kLinesSize - 1] = 0;
  std::memcpy(record, n.lines.data(), sizeof(n.lines));
  record += kLinesSize;
  for (const SplatScalar& v : values) put(v.mean, v.slope.x, v.slope.y, v.slope.z, v.variance);
}

}  // namespace

SweptNode SeamRecord::swept() const {
  const double* at = record_ + kNodePosition;
  return {{RecordSorter::alongOf(record_), RecordSorter::acrossOf(record_)}, {at[0], at[1], at[2]}, at[3]};
}

void SeamRecord::unpack(NodeSplat& n, std::span<SplatScalar> values) const {
  const double* record = record_ + 3;
  const auto get = [&] { return *record++; };
  const auto get_vector = [&] {
    record += 3;
    return glm::dvec3(record[-3], record[-2], record[-1]);
  };
  n.node = node();
  const auto flags = std::bit_cast<uint64_t>(get());
  n.regular = (flags & kRegular) != 0;
  n.on_block_face = (flags & kOnBlockFace) != 0;
  n.behind_face = (flags & kBehindFace) != 0;
  n.is_probe = (flags & kProbe) != 0;
  n.fit = (flags & kGentle) != 0 ? StretchFit::kGentle : StretchFit::kSteep;
  n.fits_layers = (flags & kFitsLayers) != 0;
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

SeamSorter::SeamSorter(size_t variables, uint64_t memory_bytes, std::filesystem::path temporary_folder)
    : variables_(variables),
      record_size_(recordBytes(variables) / sizeof(double)),
      records_(record_size_, memory_bytes, std::move(temporary_folder)) {}

size_t SeamSorter::recordBytes(size_t variables) {
  return (kNodeSize + variables * kScalarSize) * sizeof(double);
}

void SeamSorter::pack(const SeamPosition& sweep, const NodeSplat& splat, std::span<const SplatScalar> values,
                      std::vector<double>& records) const {
  CURVISPLAT_CHECK_OP(values.size(), ==, variables_);
  const size_t begin = records.size();
  records.resize(begin + record_size_);
  double* const record = records.data() + begin;
  RecordSorter::setKey(record, sweep.along, sweep.across, splat.node);
  packRest(splat, values, record + 3);
}

void SeamSorter::add(std::span<const double> records) {
  LargestReach reach;
  for (size_t at = 0; at + record_size_ <= records.size(); at += record_size_) {
    const SweptNode node = SeamRecord(&records[at]).swept();
    reach.add(node.position, node.spacing);
  }
  {
    const MutexLock lock(mutex_);
    reach_.add(reach);
  }
  records_.add(records);
}

void SeamSorter::drain(const Visit& visit) {
  records_.drain([&](const double* record) { visit(SeamRecord(record)); });
}

std::vector<SweepRange> SeamSorter::sort(unsigned visitors, int coordinate_bytes) {
  constexpr unsigned kRangesOfVisitor = 8;  // they do not take equally long
  records_.sort(visitors);
  const MutexLock lock(mutex_);
  return coincidenceRanges(
      records_, visitors * kRangesOfVisitor, [](const double* record) { return SeamRecord(record).swept(); },
      reach_, coordinate_bytes);
}

void SeamSorter::visit(const SweepRange& range, const Visit& visit) const {
  records_.visit(range.from, range.to, [&](const double* record) {
    visit(SeamRecord(record));
    return true;
  });
}

void SeamSorter::drainPacked(const std::function<void(std::span<const double>)>& visit) {
  records_.drain([&](const double* record) { visit({record, record_size_}); });
}

}  // namespace curvisplat
