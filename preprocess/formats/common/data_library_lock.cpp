#include "preprocess/formats/common/data_library_lock.h"

namespace curvisplat {

Mutex& dataLibraryMutex() {
  static Mutex mutex;
  return mutex;
}

}  // namespace curvisplat
