#include "preprocess/formats/netcdf/netcdf_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <functional>
#include <mutex>
#include <numeric>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/hdf5_objects.h"
#include "preprocess/formats/common/library_trial.h"
#include "preprocess/formats/common/text_reader.h"
#include "preprocess/formats/netcdf/netcdf_library.h"
#include "preprocess/formats/netcdf/netcdf_structure.h"
#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

// The cache of chunks of each open variable: the rows of a slab usually lie in a few chunks.
constexpr size_t kChunkCacheBytes = size_t{2} << 20;
constexpr size_t kChunkCacheSlots = 1009;
constexpr float kChunkCachePreemption = 0.75f;
// Limit for attributes: they hold descriptions, not data.
constexpr size_t kMaxAttributeValues = size_t{1} << 20;
constexpr double kMaxAttributeBytes = 1 << 24;
constexpr double kMaxAttributeStrings = 1 << 16;
// Deflate shrinks zeros to about a thousandth.
constexpr double kMaxCompression = 1100;
constexpr const char* kNetcdf4 = "NetCDF-4";

bool isClassic(std::string_view mark) {
  return mark.starts_with("CDF\x01") || mark.starts_with("CDF\x02") || mark.starts_with("CDF\x05");
}

}  // namespace

size_t NetcdfBox::values() const {
  return std::accumulate(count.begin(), count.end(), size_t{1}, std::multiplies<>());
}

bool NetcdfFile::recognises(const InputFile& file) {
  const std::string mark = beginningOf(file, 8);
  return mark.size() == 8 && (isClassic(mark) || mark == kHdf5Signature);
}

NetcdfFile::NetcdfFile(const std::filesystem::path& path) : path_(path) {
  const InputFile file(path);
  const uint64_t bytes = file.size();
  std::array<char, 4> begin{};
  if (bytes >= begin.size()) file.readAt(0, std::span<char>(begin));
  if (isClassic({begin.data(), begin.size()}))
    records_ = checkClassicNetcdf(file);
  else {
    requireWholeHdf5(file);
    tryHdf5(path, [&] { const NetcdfFile again(path); });
    plain_hdf5_ = !checkNetcdf4Structure(path).netcdf4;
  }
  watched_ = WatchedFiles({path_.string()});
  const QuietHdf5 quiet;
  nc_set_chunk_cache(kChunkCacheBytes, kChunkCacheSlots, kChunkCachePreemption);
  // NetCDF takes some relative paths for URLs.
  const std::filesystem::path absolute = std::filesystem::absolute(path);
  if (const int status = nc_open(absolute.c_str(), NC_NOWRITE, &file_); status != NC_NOERR) {
    if (plain_hdf5_)
      throw Error("{}: is an HDF5 file, but neither NetCDF-4 nor CGNS ({}); expected one of these",
                  path_.string(), nc_strerror(status));
    fail("the file", status);
  }
  try {
    readHeader();
    readGroups();
    if (kind_ == kNetcdf4) checkSizes(bytes);
  } catch (...) {
    nc_close(file_);
    throw;
  }
}

NetcdfFile::~NetcdfFile() {
  const QuietHdf5 quiet;
  if (file_ >= 0) nc_close(file_);
}

void NetcdfFile::release() const {
  const QuietHdf5 quiet;
  // An unpacked file loses its name (unpacked_file.h), so it stays open; only its variables' caches are
  // emptied.
  if (path_.parent_path().extension() == ".unpacked") return emptyCaches();
  if (file_ >= 0) nc_close(file_);
  file_ = -1;
}

void NetcdfFile::emptyCaches() const {
  if (file_ < 0 || kind_ != kNetcdf4) return;
  int count = 0;
  if (nc_inq_nvars(file_, &count) != NC_NOERR) return;
  // Sets what is set: the library closes the data set, which frees its chunks, and opens it again.
  for (int id = 0; id < count; ++id)
    nc_set_var_chunk_cache(file_, id, kChunkCacheBytes, kChunkCacheSlots, kChunkCachePreemption);
}

int NetcdfFile::opened() const {
  if (file_ >= 0) return file_;
  watched_.requireSame();
  nc_set_chunk_cache(kChunkCacheBytes, kChunkCacheSlots, kChunkCachePreemption);
  if (const int status = nc_open(std::filesystem::absolute(path_).c_str(), NC_NOWRITE, &file_);
      status != NC_NOERR) {
    file_ = -1;
    fail("the file", status);
  }
  return file_;
}

void NetcdfFile::fail(const std::string& place, int status) const {
  if (status == NC_ENOFILTER)
    throw Error(
        "{}: {} is compressed by a filter that HDF5 lacks here (LZF of h5py, Blosc, ...); write it with "
        "deflate, "
        "where the filter is installed (h5repack -f GZIP=1)",
        path_.string(), place);
  throw Error("{}: {} cannot be read as NetCDF: {}; if the file is damaged, copy or write it again",
              path_.string(), place, nc_strerror(status));
}

void NetcdfFile::readHeader() {
  int dimensions = 0, variables = 0, attributes = 0, unlimited = -1, format = 0;
  int status = nc_inq(file_, &dimensions, &variables, &attributes, &unlimited);
  if (status == NC_NOERR) status = nc_inq_format(file_, &format);
  if (status != NC_NOERR) fail("the header", status);
  kind_ = format == NC_FORMAT_NETCDF4 || format == NC_FORMAT_NETCDF4_CLASSIC ? kNetcdf4 : "NetCDF classic";

  std::vector<int> ids(static_cast<size_t>(std::max(0, dimensions)));
  // NetCDF-4's dimension ids need not be consecutive.
  int found = 0;
  if ((status = nc_inq_dimids(file_, &found, ids.data(), 0)) != NC_NOERR || found != dimensions)
    fail("the list of dimensions", status);
  int most = -1;
  for (const int id : ids) most = std::max(most, id);
  if (most >= (1 << 20))
    throw Error("{}: has a dimension with the id {}; the file is damaged", path_.string(), most);
  dimensions_.resize(static_cast<size_t>(most + 1));
  for (const int id : ids) {
    char name[NC_MAX_NAME + 1] = {};
    size_t length = 0;
    if ((status = nc_inq_dim(file_, id, name, &length)) != NC_NOERR) fail("a dimension", status);
    if (id == unlimited) length = records_.value_or(length);
    dimensions_[static_cast<size_t>(id)] = {name, length, id == unlimited};
  }
  for (int id = 0; id < variables; ++id) readVariable(id);
  of_file_.name = "the file";
  readAttributes(NC_GLOBAL, attributes, of_file_);
}

void NetcdfFile::readGroups() {
  int count = 0;
  if (nc_inq_grps(file_, &count, nullptr) != NC_NOERR || count <= 0) return;
  std::vector<int> groups(static_cast<size_t>(count));
  if (nc_inq_grps(file_, &count, groups.data()) != NC_NOERR) return;
  for (const int group : groups) {
    int variables = 0, further = 0;
    char name[NC_MAX_NAME + 1] = {};
    if (nc_inq_nvars(group, &variables) == NC_NOERR && nc_inq_grps(group, &further, nullptr) == NC_NOERR &&
        nc_inq_grpname(group, name) == NC_NOERR && variables + further > 0)
      groups_.emplace_back(name);
  }
}

void NetcdfFile::readVariable(int id) {
  char name[NC_MAX_NAME + 1] = {};
  nc_type type = NC_NAT;
  int dimensions = 0, attributes = 0;
  int status = nc_inq_var(file_, id, name, &type, &dimensions, nullptr, &attributes);
  if (status != NC_NOERR) fail("a variable", status);
  std::vector<int> ids(static_cast<size_t>(dimensions));
  if ((status = nc_inq_vardimid(file_, id, ids.data())) != NC_NOERR) fail(name, status);

  NetcdfVariable variable;
  variable.name = name;
  variable.id = id;
  variable.type = type;
  variable.value_bytes = netcdfBytes(type);
  variable.numeric = variable.value_bytes > 0;
  for (const int dimension : ids) {
    if (dimension < 0 || static_cast<size_t>(dimension) >= dimensions_.size())
      throw Error("{}: {} refers to a dimension that does not exist; the file is damaged", path_.string(),
                  name);
    variable.dims.push_back(static_cast<size_t>(dimension));
  }
  readAttributes(id, attributes, variable);
  addVariable(std::move(variable));
}

void NetcdfFile::addVariable(NetcdfVariable variable) {
  variable.position = variables_.size();
  packings_.emplace_back(variable);
  variables_.push_back(std::move(variable));
}

void NetcdfFile::readAttributes(int id, int count, NetcdfVariable& variable) const {
  for (int n = 0; n < count; ++n) {
    char name[NC_MAX_NAME + 1] = {};
    nc_type type = NC_NAT;
    size_t length = 0;
    int status = nc_inq_attname(file_, id, n, name);
    if (status == NC_NOERR) status = nc_inq_att(file_, id, name, &type, &length);
    if (status != NC_NOERR) fail("an attribute of " + variable.name, status);
    if (length > kMaxAttributeValues) continue;
    NetcdfAttribute attribute;
    attribute.type = type;
    if (type == NC_CHAR) {
      attribute.text.resize(length);
      status = nc_get_att_text(file_, id, name, attribute.text.data());
      attribute.text.resize(std::min(attribute.text.find('\0'), attribute.text.size()));
    } else if (type == NC_STRING && length == 1) {
      char* text = nullptr;
      status = nc_get_att_string(file_, id, name, &text);
      if (status == NC_NOERR && text) attribute.text = text;
      if (status == NC_NOERR) nc_free_string(1, &text);
    } else if (netcdfBytes(type) > 0) {
      attribute.numbers.resize(length);
      status = nc_get_att_double(file_, id, name, attribute.numbers.data());
    }
    if (status != NC_NOERR) fail(fmt::format("attribute {} of {}", name, variable.name), status);
    variable.add(name, std::move(attribute));
  }
}

void NetcdfFile::checkSizes(uint64_t file_bytes) const {
  const double most = static_cast<double>(file_bytes) * kMaxCompression;
  for (const NetcdfVariable& variable : variables_) {
    auto bytes = static_cast<double>(variable.value_bytes);
    for (const size_t dim : variable.dims) bytes *= static_cast<double>(dimensions_[dim].length);
    if (bytes > most)
      throw Error(
          "{}: {} declares {:.0f} bytes, more than a file of {} bytes can hold; the file is damaged: copy "
          "or write it again",
          path_.string(), variable.name, bytes, file_bytes);
  }
}

const NetcdfVariable* NetcdfFile::find(std::string_view name) const {
  for (const NetcdfVariable& variable : variables_)
    if (variable.name == name) return &variable;
  return nullptr;
}

std::optional<double> NetcdfFile::number(const char* attribute) const {
  const std::vector<double> found = numbers(attribute);
  return found.size() == 1 ? std::optional(found[0]) : std::nullopt;
}

const NetcdfDimension& NetcdfFile::dimension(const NetcdfVariable& variable, size_t axis) const {
  return dimensions_.at(variable.dims.at(axis));
}

template <typename Value, typename Get>
void NetcdfFile::readWith(const Get& get, const NetcdfVariable& variable, const NetcdfBox& box,
                          std::span<Value> to) const {
  const QuietHdf5 quiet;
  const int status = get(opened(), variable.id, box.start.data(), box.count.data(), to.data());
  // NC_ERANGE: a number too large for a float becomes infinite, which blanks its sample.
  if (status != NC_NOERR && status != NC_ERANGE) fail(variable.name, status);
  watched_.requireWhole();
}

std::string NetcdfFile::readText(const NetcdfVariable& variable) const {
  const std::vector<size_t>& dims = variables_.at(variable.position).dims;  // of this file, not of several
  const std::vector<size_t> start(dims.size(), 0);
  std::vector<size_t> count;
  double bytes = 1;
  for (const size_t dim : dims) {
    count.push_back(dimensions_.at(dim).length);
    bytes *= static_cast<double>(count.back());
  }
  if (variable.type != NC_CHAR || bytes > kMaxAttributeBytes) return "";
  std::string text(static_cast<size_t>(bytes), ' ');
  const QuietHdf5 quiet;
  const int status = nc_get_vara_text(opened(), variable.id, start.data(), count.data(), text.data());
  if (status != NC_NOERR) fail(variable.name, status);
  return text;
}

std::vector<std::string> NetcdfFile::readStrings(const NetcdfVariable& variable) const {
  const std::vector<size_t>& dims = variables_.at(variable.position).dims;
  NetcdfBox all{std::vector<size_t>(dims.size(), 0), {}};
  double strings = 1;
  for (size_t n = 0; n < dims.size(); ++n) {
    all.count.push_back(dimensions_.at(dims[n]).length);
    if (variable.type == NC_STRING || n + 1 < dims.size()) strings *= static_cast<double>(all.count[n]);
  }
  std::vector<std::string> found;
  if (strings > kMaxAttributeStrings) return found;
  if (variable.type == NC_STRING) {
    std::vector<char*> stored(static_cast<size_t>(strings), nullptr);
    const QuietHdf5 quiet;
    const int status =
        nc_get_vara_string(opened(), variable.id, all.start.data(), all.count.data(), stored.data());
    if (status != NC_NOERR) fail(variable.name, status);
    for (const char* string : stored) found.emplace_back(string ? string : "");
    nc_free_string(stored.size(), stored.data());
    return found;
  }
  const std::string text = readText(variable);
  const size_t length = all.count.empty() ? text.size() : all.count.back();
  for (size_t at = 0; length > 0 && at + length <= text.size(); at += length) {
    std::string& string = found.emplace_back(text.substr(at, length));
    string.resize(std::min(string.size(), string.find('\0')));
    string.erase(string.find_last_not_of(' ') + 1);
  }
  return found;
}

void NetcdfFile::readStored(const NetcdfVariable& variable, const NetcdfBox& box,
                            std::span<double> to) const {
  readWith(nc_get_vara_double, variable, box, to);
}

void NetcdfFile::readStored(const NetcdfVariable& variable, const NetcdfBox& box, std::span<float> to) const {
  readWith(nc_get_vara_float, variable, box, to);
}

template <typename Value>
void NetcdfFile::readUnpacked(const NetcdfVariable& variable, const NetcdfBox& box,
                              std::span<Value> to) const {
  CURVISPLAT_CHECK_OP(box.start.size(), ==, variable.dims.size());
  CURVISPLAT_CHECK_OP(box.values(), <=, to.size());
  readStored(variable, box, to);
  packings_.at(variable.position).unpack(to.first(box.values()));
}

void NetcdfFile::read(const NetcdfVariable& variable, const NetcdfBox& box, std::span<double> to) const {
  readUnpacked(variable, box, to);
}

void NetcdfFile::read(const NetcdfVariable& variable, const NetcdfBox& box, std::span<float> to) const {
  readUnpacked(variable, box, to);
  if (variable.type == NC_DOUBLE)
    convertIfZero(to.first(box.values()), [&](std::span<double> stored) { read(variable, box, stored); });
}

}  // namespace curvisplat
