// Leaves corrections of the method out, to see what they are worth.
#pragma once

#include "stream/model/corrections.h"

namespace curvisplat {
namespace of_tests {

extern Corrections corrections;

}  // namespace of_tests

/// Makes only these corrections until the end of the scope. Not while other threads work.
class WithCorrections {
 public:
  explicit WithCorrections(const Corrections& corrections) : before_(of_tests::corrections) {
    of_tests::corrections = corrections;
  }
  ~WithCorrections() { of_tests::corrections = before_; }
  WithCorrections(const WithCorrections&) = delete;
  WithCorrections& operator=(const WithCorrections&) = delete;

 private:
  const Corrections before_;
};

}  // namespace curvisplat
