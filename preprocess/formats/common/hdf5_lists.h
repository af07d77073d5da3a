// The lists of links and attributes of an HDF5 object, checked before they are read in an order of their own.
// Where a stored list is damaged or of another length than its object says, HDF5 (1.10) frees entries of its
// sorted list that it has not set, and writes beyond its end. Reading in the file's own order sorts nothing.
#pragma once

#include <hdf5.h>

namespace curvisplat {

/// Whether the links of `group` can be read and are as many as it says. Holds dataLibraryMutex().
bool linksAreWhole(hid_t group);

/// Whether the attributes of `object` can be read and are as many as it says. Holds dataLibraryMutex().
bool attributesAreWhole(hid_t object);

}  // namespace curvisplat
