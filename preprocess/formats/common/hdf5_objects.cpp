#include "preprocess/formats/common/hdf5_objects.h"

#include <fmt/format.h>

#include <exception>

namespace curvisplat {

Mutex& dataLibraryMutex() {
  static Mutex mutex;
  return mutex;
}

const char* describe(H5T_class_t kind) {
  switch (kind) {
    case H5T_INTEGER:
      return "integers";
    case H5T_FLOAT:
      return "floating-point numbers";
    case H5T_STRING:
      return "strings";
    case H5T_COMPOUND:
      return "compounds";
    case H5T_REFERENCE:
      return "references";
    case H5T_VLEN:
      return "lists of variable length";
    case H5T_ARRAY:
      return "arrays";
    case H5T_ENUM:
      return "enumerators";
    case H5T_OPAQUE:
      return "opaque bytes";
    default:
      return "values of an unknown type";
  }
}

std::string Hdf5AttributeShape::describe() const {
  if (variable_string) return fmt::format("{} strings of variable length", values);
  return fmt::format("{} {} of {} bytes", values, curvisplat::describe(kind), value_bytes);
}

std::string hdf5Reason() {
  std::string reason;
  const auto first = [](unsigned, const H5E_error2_t* error, void* text) -> herr_t {
    try {
      *static_cast<std::string*>(text) = error->desc ? error->desc : "";
      return 1;
    } catch (const std::exception&) {
      return -1;
    }
  };
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, first, &reason);
  return reason.empty() ? "no reason given" : reason;
}

std::optional<Hdf5AttributeShape> shapeOf(const Hdf5Attribute& attribute) {
  if (!attribute) return std::nullopt;
  const Hdf5Type type(H5Aget_type(attribute.id()));
  const Hdf5Space space(H5Aget_space(attribute.id()));
  if (!type || !space) return std::nullopt;
  const hssize_t values = H5Sget_simple_extent_npoints(space.id());
  const int rank = H5Sget_simple_extent_ndims(space.id());
  Hdf5AttributeShape shape;
  shape.kind = H5Tget_class(type.id());
  shape.value_bytes = H5Tget_size(type.id());
  if (values < 0 || rank < 0 || shape.kind == H5T_NO_CLASS || shape.value_bytes == 0) return std::nullopt;
  shape.rank = rank;
  shape.values = static_cast<uint64_t>(values);
  shape.variable_string = shape.kind == H5T_STRING && H5Tis_variable_str(type.id()) > 0;
  if (shape.kind == H5T_VLEN || shape.kind == H5T_ARRAY) {
    const Hdf5Type element(H5Tget_super(type.id()));
    if (!element) return std::nullopt;
    shape.element_kind = H5Tget_class(element.id());
  }
  return shape;
}

bool linksAreWhole(hid_t group) {
  H5G_info_t info;
  hsize_t found = 0;
  const auto count = [](hid_t, const char*, const H5L_info_t*, void* to) -> herr_t {
    ++*static_cast<hsize_t*>(to);
    return 0;
  };
  return H5Gget_info(group, &info) >= 0 &&
         H5Literate(group, H5_INDEX_NAME, H5_ITER_NATIVE, nullptr, count, &found) >= 0 &&
         found == info.nlinks;
}

std::optional<std::vector<Hdf5Link>> linksOf(hid_t group) {
  if (!linksAreWhole(group)) return std::nullopt;
  std::vector<Hdf5Link> links;
  const auto add = [](hid_t, const char* name, const H5L_info_t* info, void* to) -> herr_t {
    try {
      static_cast<std::vector<Hdf5Link>*>(to)->push_back({name, info->type == H5L_TYPE_EXTERNAL});
      return 0;
    } catch (const std::exception&) {
      return -1;
    }
  };
  for (const H5_index_t order : {H5_INDEX_CRT_ORDER, H5_INDEX_NAME}) {
    links.clear();
    hsize_t position = 0;
    if (H5Literate(group, order, H5_ITER_INC, &position, add, &links) >= 0) return links;
  }
  return std::nullopt;
}

bool attributesAreWhole(hid_t object) {
  H5O_info_t info;
  hsize_t found = 0;
  const auto count = [](hid_t, const char*, const H5A_info_t*, void* to) -> herr_t {
    ++*static_cast<hsize_t*>(to);
    return 0;
  };
  return H5Oget_info2(object, &info, H5O_INFO_NUM_ATTRS) >= 0 &&
         H5Aiterate2(object, H5_INDEX_NAME, H5_ITER_NATIVE, nullptr, count, &found) >= 0 &&
         found == info.num_attrs;
}

}  // namespace curvisplat
