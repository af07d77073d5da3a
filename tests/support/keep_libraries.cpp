// Keeps libraries loaded for the leak sanitizer, in the program: a driver that is unloaded before the program
// ends leaves what it has not freed with a stack in <unknown module>, which no suppression can name.
// Libraries stay.
#include <dlfcn.h>

extern "C" int dlclose(void*) noexcept {
  return 0;
}
