#include "preprocess/formats/common/hdf5_lists.h"

namespace curvisplat {

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
