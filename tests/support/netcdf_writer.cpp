#include "tests/support/netcdf_writer.h"

#include <netcdf.h>

#include <algorithm>
#include <stdexcept>

namespace curvisplat {
namespace {

void check(int status) {
  if (status != NC_NOERR) throw std::runtime_error(std::string("NetcdfWriter: ") + nc_strerror(status));
}

nc_type typeOf(NetcdfNumbers numbers) {
  switch (numbers) {
    case NetcdfNumbers::kInt16:
      return NC_SHORT;
    case NetcdfNumbers::kInt32:
      return NC_INT;
    case NetcdfNumbers::kSinglePrecision:
      return NC_FLOAT;
    default:
      return NC_DOUBLE;
  }
}

}  // namespace

NetcdfWriter::NetcdfWriter(const std::filesystem::path& path, NetcdfFileType type) : type_(type) {
  check(nc_create(path.c_str(), NC_CLOBBER | (type == NetcdfFileType::kClassic ? 0 : NC_NETCDF4), &file_));
  check(nc_enddef(file_));
}

NetcdfWriter::~NetcdfWriter() {
  nc_close(file_);
}

void NetcdfWriter::dimension(const std::string& name, size_t length, bool unlimited) {
  check(nc_redef(file_));
  Dimension dimension{name, length, 0};
  check(nc_def_dim(file_, name.c_str(), unlimited ? NC_UNLIMITED : length, &dimension.id));
  check(nc_enddef(file_));
  dimensions_.push_back(dimension);
}

void NetcdfWriter::attribute(const std::string& name, const std::string& text) {
  check(nc_redef(file_));
  check(nc_put_att_text(file_, NC_GLOBAL, name.c_str(), text.size(), text.data()));
  check(nc_enddef(file_));
}

const NetcdfWriter::Dimension& NetcdfWriter::named(const std::string& name) const {
  const auto found = std::find_if(dimensions_.begin(), dimensions_.end(),
                                  [&](const Dimension& dimension) { return dimension.name == name; });
  if (found == dimensions_.end()) throw std::runtime_error("NetcdfWriter: no dimension " + name);
  return *found;
}

void NetcdfWriter::variable(const std::string& name, NetcdfNumbers numbers,
                            const std::vector<std::string>& dimensions, const NetcdfAttributes& attributes,
                            const NetcdfFunction& value) {
  std::vector<int> ids;
  std::vector<size_t> count;
  for (const std::string& dimension : dimensions) {
    ids.push_back(named(dimension).id);
    count.push_back(named(dimension).length);
  }
  int id = 0;
  check(nc_redef(file_));
  check(nc_def_var(file_, name.c_str(), typeOf(numbers), static_cast<int>(ids.size()), ids.data(), &id));
  if (type_ == NetcdfFileType::kNetcdf4Compressed && !ids.empty())
    check(nc_def_var_deflate(file_, id, 1, 1, 4));
  for (const auto& [key, attribute] : attributes) {
    if (const auto* const text = std::get_if<NetcdfText>(&attribute)) {
      check(nc_put_att_text(file_, id, key.c_str(), text->size(), text->data()));
      continue;
    }
    if (const auto* const doubles = std::get_if<NetcdfDoubleList>(&attribute)) {
      const auto& values = doubles->values;
      check(nc_put_att_double(file_, id, key.c_str(), NC_DOUBLE, values.size(), values.data()));
      continue;
    }
    const auto& list = std::get<NetcdfNumberList>(attribute);
    // How to unpack is told in what it is unpacked to.
    const bool packing = key == "scale_factor" || key == "add_offset";
    check(nc_put_att_double(file_, id, key.c_str(), packing ? NC_DOUBLE : typeOf(numbers), list.size(),
                            list.data()));
  }
  check(nc_enddef(file_));

  std::vector<double> values;
  std::vector<size_t> index(count.size(), 0);
  size_t total = 1;
  for (const size_t n : count) total *= n;
  for (size_t n = 0; n < total; ++n) {
    values.push_back(value(index));
    for (size_t d = count.size(); d-- > 0;) {
      if (++index[d] < count[d]) break;
      index[d] = 0;
    }
  }
  const std::vector<size_t> start(count.size(), 0);
  check(nc_put_vara_double(file_, id, start.data(), count.data(), values.data()));
}

}  // namespace curvisplat
