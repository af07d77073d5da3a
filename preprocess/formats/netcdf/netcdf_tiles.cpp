#include "preprocess/formats/netcdf/netcdf_tiles.h"

#include <algorithm>
#include <limits>
#include <string_view>
#include <utility>

#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr size_t kMaxOpen = 8;

/// "restart_0001.nc" -> "restart_.nc", with the folder.
std::string withoutNumber(const std::filesystem::path& path) {
  std::string name = path.stem().string();
  name.erase(name.find_last_not_of("0123456789") + 1);
  return (path.parent_path() / name).string() + path.extension().string();
}

/// Two whole numbers of at least 0; nullopt if the attribute holds anything else.
std::optional<std::array<uint64_t, 2>> pairIn(const NetcdfFile& file, const char* attribute) {
  const std::vector<double> numbers = file.numbers(attribute);
  if (numbers.size() != 2) return std::nullopt;
  std::array<uint64_t, 2> pair{};
  for (size_t n = 0; n < 2; ++n) {
    if (!(numbers[n] >= 0 && numbers[n] <= std::numeric_limits<int32_t>::max())) return std::nullopt;
    pair[n] = static_cast<uint64_t>(numbers[n]);
  }
  return pair;
}

/// The dimension along x (0) or y (1): by its number from 1, else by its name, if it has the length.
std::optional<size_t> dimensionAlong(const NetcdfFile& file, size_t direction, uint64_t number,
                                     uint64_t length) {
  const std::vector<NetcdfDimension>& dims = file.dimensions();
  const auto fits = [&](size_t dim) {
    return dim < dims.size() && !dims[dim].name.empty() && dims[dim].length == length;
  };
  if (number > 0 && fits(number - 1)) return number - 1;
  for (size_t dim = 0; dim < dims.size(); ++dim)
    if (fits(dim) && lowerCase(dims[dim].name).starts_with(direction == 0 ? 'x' : 'y')) return dim;
  return std::nullopt;
}

}  // namespace

std::optional<NetcdfDomain> NetcdfDomain::of(const NetcdfFile& file) {
  const double total = file.number("DOMAIN_number_total").value_or(0);
  if (!(total >= 2 && total <= std::numeric_limits<int32_t>::max())) return std::nullopt;
  const auto ids = pairIn(file, "DOMAIN_dimensions_ids"), whole = pairIn(file, "DOMAIN_size_global"),
             own = pairIn(file, "DOMAIN_size_local"), first = pairIn(file, "DOMAIN_position_first");
  if (!ids || !whole || !own || !first) return std::nullopt;
  const std::array<uint64_t, 2> none{};
  NetcdfDomain domain{static_cast<uint64_t>(total),
                      {},
                      *whole,
                      *first,
                      pairIn(file, "DOMAIN_halo_size_start").value_or(none),
                      pairIn(file, "DOMAIN_halo_size_end").value_or(none)};
  for (size_t n = 0; n < 2; ++n) {
    const auto dim = dimensionAlong(file, n, (*ids)[n], (*own)[n]);
    if (!dim || domain.before[n] + domain.after[n] >= (*own)[n] || (*first)[n] + (*own)[n] > (*whole)[n] + 1)
      throw Error(
          "{}: is one part of {} of a map, but its attributes DOMAIN_* do not fit its dimensions (position "
          "{} with {} values of {}); the file is damaged: copy or write it again",
          file.path().string(), total, (*first)[n], (*own)[n], (*whole)[n]);
    domain.dims[n] = *dim;
  }
  return domain;
}

NetcdfTiles::NetcdfTiles(std::unique_ptr<NetcdfFile> file, std::optional<NetcdfDomain> domain) {
  parts_.push_back({std::move(file), domain});
}

bool NetcdfTiles::includes(const NetcdfFile& file, const std::optional<NetcdfDomain>& domain) const {
  const std::optional<NetcdfDomain>& own = parts_.front().domain;
  return domain && own && domain->whole == own->whole &&
         withoutNumber(file.path()) == withoutNumber(front().path());
}

void NetcdfTiles::add(std::unique_ptr<NetcdfFile> file, const NetcdfDomain& domain) {
  const auto& dims = front().dimensions();
  bool same = file->dimensions().size() == dims.size() && domain.dims == parts_.front().domain->dims;
  for (size_t dim = 0; same && dim < dims.size(); ++dim)
    same = file->dimensions()[dim].name == dims[dim].name &&
           (dim == domain.dims[0] || dim == domain.dims[1] ||
            file->dimensions()[dim].length == dims[dim].length);
  if (!same)
    throw Error("{}: has other dimensions or times than {}, whose map it is a part of; give parts of one run",
                file->path().string(), front().path().string());
  if (parts_.size() >= kMaxOpen) file->release();
  parts_.push_back({std::move(file), domain});
  for (const Part& part : parts_)
    if (part.domain->first[0] == 0 || part.domain->first[1] == 0) origin_ = 0;
}

std::vector<std::string> NetcdfTiles::paths() const {
  std::vector<std::string> paths;
  for (const Part& part : parts_) paths.push_back(part.file->path().string());
  return paths;
}

std::optional<size_t> NetcdfTiles::directionOf(size_t dimension) const {
  if (parts_.size() == 1) return std::nullopt;
  const std::array<size_t, 2>& dims = parts_.front().domain->dims;
  if (dimension == dims[0]) return 0;
  if (dimension == dims[1]) return 1;
  return std::nullopt;
}

uint64_t NetcdfTiles::length(size_t dimension) const {
  const auto direction = directionOf(dimension);
  return direction ? parts_.front().domain->whole[*direction] : front().dimensions()[dimension].length;
}

template <typename Value>
void NetcdfTiles::read(const NetcdfVariable& variable, const NetcdfBox& box, std::span<Value> to) const {
  const std::vector<size_t>& dims = front().variables().at(variable.position).dims;
  if (std::none_of(dims.begin(), dims.end(), [&](size_t dim) { return directionOf(dim).has_value(); }))
    return front().read(variable, box, to);
  std::fill_n(to.begin(), box.values(), std::numeric_limits<Value>::quiet_NaN());
  for (const Part& part : parts_) readPart(part, variable, box, to);
}

/// Reads what a part has of the box, and copies it to its place there.
template <typename Value>
void NetcdfTiles::readPart(const Part& part, const NetcdfVariable& variable, const NetcdfBox& box,
                           std::span<Value> to) const {
  const NetcdfVariable& of_front = front().variables().at(variable.position);
  NetcdfBox stored = box, place = box;  // in the part's file; in the box
  for (size_t d = 0; d < box.start.size(); ++d) {
    place.start[d] = 0;
    const auto direction = directionOf(of_front.dims[d]);
    if (!direction) continue;
    const uint64_t n = *direction, first = part.domain->first[n] - origin_;
    const uint64_t length = part.file->dimensions()[of_front.dims[d]].length;
    const uint64_t begin = std::max<uint64_t>(box.start[d], first + part.domain->before[n]);
    const uint64_t end =
        std::min<uint64_t>(box.start[d] + box.count[d], first + length - part.domain->after[n]);
    if (begin >= end) return;
    stored.start[d] = begin - first;
    place.start[d] = begin - box.start[d];
    stored.count[d] = place.count[d] = end - begin;
  }
  const NetcdfVariable* const own = part.file->find(variable.name);
  if (!own || own->dims != of_front.dims)
    throw Error("{}: has no {} like {}; give parts of one run", part.file->path().string(), variable.name,
                front().path().string());
  std::vector<Value> values(stored.values());
  part.file->read(*own, stored, std::span(values));
  if (parts_.size() > kMaxOpen) part.file->release();
  const size_t row = place.count.back();
  std::vector<size_t> at(place.count.size(), 0);  // of the row, among those that were read
  for (size_t from = 0; from < values.size(); from += row) {
    size_t n = 0;
    for (size_t d = 0; d < at.size(); ++d) n = n * box.count[d] + place.start[d] + at[d];
    std::copy_n(&values[from], row, &to[n]);
    for (size_t d = at.size() - 1; d-- > 0 && ++at[d] == place.count[d];) at[d] = 0;
  }
}

template void NetcdfTiles::read(const NetcdfVariable&, const NetcdfBox&, std::span<double>) const;
template void NetcdfTiles::read(const NetcdfVariable&, const NetcdfBox&, std::span<float>) const;

void NetcdfTiles::release() const {
  for (const Part& part : parts_) part.file->release();
}

}  // namespace curvisplat
