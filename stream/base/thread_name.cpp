#include "stream/base/thread_name.h"

#include <pthread.h>

namespace curvisplat {

void nameThisThread(const char* name) {
  pthread_setname_np(pthread_self(), name);
}

}  // namespace curvisplat
