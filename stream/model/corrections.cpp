#include "stream/model/corrections.h"

namespace curvisplat {
namespace of_tests {

extern Corrections corrections;  // declared again in tests/support/with_corrections.h, and nowhere else
Corrections corrections;

}  // namespace of_tests

const Corrections& correctionsToMake() {
  return of_tests::corrections;
}

}  // namespace curvisplat
