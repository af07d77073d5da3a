#include "preprocess/formats/common/data_library_lock.h"

namespace curvisplat {

std::mutex& dataLibraryMutex() {
  static std::mutex mutex;
  return mutex;
}

}  // namespace curvisplat
