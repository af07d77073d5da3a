#include "stream/codec/log_codes.h"

#include <algorithm>
#include <cmath>

// The code from here to HWY_AFTER_NAMESPACE is compiled once for every instruction set that a processor may
// have.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "stream/codec/log_codes.cpp"
#include <hwy/foreach_target.h>  // before the others

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace curvisplat {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// The smallest and the largest value.
void findRange(std::span<const double> values, double& least, double& most) {
  const hn::ScalableTag<double> d;
  const size_t lanes = hn::Lanes(d), whole = values.size() / lanes * lanes;
  auto low = hn::Set(d, values[0]), high = low;
  for (size_t n = 0; n < whole; n += lanes) {
    const auto v = hn::LoadU(d, values.data() + n);
    low = hn::Min(low, v);
    high = hn::Max(high, v);
  }
  least = hn::GetLane(hn::MinOfLanes(d, low));
  most = hn::GetLane(hn::MaxOfLanes(d, high));
  for (const double value : values.subspan(whole)) {
    least = std::min(least, value);
    most = std::max(most, value);
  }
}

/// Does what logCodes() does, but writes -1 where a code is in doubt.
void approximateCodes(std::span<const double> values, double lowest, double step, int32_t* codes) {
  constexpr double kInDoubt = 1e-6;  // of a step, which is far above what the logarithms differ by
  const hn::ScalableTag<double> d;
  const hn::Rebind<int32_t, decltype(d)> integers;
  const size_t lanes = hn::Lanes(d), whole = values.size() / lanes * lanes;
  const auto steps = hn::Set(d, 1 / step), base = hn::Set(d, lowest), half = hn::Set(d, 0.5);
  for (size_t n = 0; n < whole; n += lanes) {
    const auto logarithm = hn::Log(d, hn::LoadU(d, values.data() + n));
    const auto code = hn::Add(hn::Mul(hn::Sub(logarithm, base), steps), half);
    const auto in_doubt = hn::Lt(hn::Abs(hn::Sub(code, hn::Round(code))), hn::Set(d, kInDoubt));
    hn::StoreU(hn::DemoteTo(integers, hn::IfThenElse(in_doubt, hn::Set(d, -1), code)), integers, codes + n);
  }
  for (size_t n = whole; n < values.size(); ++n) codes[n] = -1;
}

}  // namespace HWY_NAMESPACE
}  // namespace curvisplat
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace curvisplat {

HWY_EXPORT(findRange);
HWY_EXPORT(approximateCodes);

std::optional<LogCodes> logCodes(std::span<const double> values, double step, uint32_t too_large,
                                 uint32_t* codes) {
  double least = 0, most = 0;
  HWY_DYNAMIC_DISPATCH(findRange)(values, least, most);
  const double lowest = std::log(least), steps = (std::log(most) - lowest) / step;
  if (!(steps < too_large)) return std::nullopt;
  HWY_DYNAMIC_DISPATCH(approximateCodes)(values, lowest, step, reinterpret_cast<int32_t*>(codes));
  for (size_t n = 0; n < values.size(); ++n)
    if (static_cast<int32_t>(codes[n]) < 0)
      codes[n] = static_cast<uint32_t>((std::log(values[n]) - lowest) / step + 0.5);
  return LogCodes{lowest, static_cast<uint32_t>(steps) + 1};
}

}  // namespace curvisplat
#endif
