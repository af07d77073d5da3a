// steps.bin, the time steps of a cache; the manifest's entry of it is made right here. A byte with the number of
// variables, and the file. What is read is in the order of time, and each step's geometry is there.
#include "stream/cache/steps_file.h"

#include <cmath>

#include "stream/base/check.h"
#include "stream/base/checksum.h"
#include "tests/fuzz/fuzz_target.h"

namespace curvisplat {
namespace {

void fuzzSteps(std::span<const std::byte> bytes) {
  FuzzInput input(bytes);
  Manifest manifest;
  manifest.variables.resize(1 + input.take<uint8_t>() % 4);
  fuzzFile(kStepsFileName, input.rest());
  manifest.files.push_back({kStepsFileName, input.rest().size(), checksumOf(input.rest())});
  manifest.requirements = {"steps"};
  const Series series = readSeries(fuzzFolder(), manifest);
  for (size_t step = 0; step < series.steps.size(); ++step) {
    const SeriesStep& of = series.steps[step];
    CURVISPLAT_CHECK(of.geometry < series.geometries());
    CURVISPLAT_CHECK(std::isfinite(of.time));
    if (step > 0) CURVISPLAT_CHECK(of.time > series.steps[step - 1].time);
    CURVISPLAT_CHECK_OP(series.nearest(of.time), <, series.steps.size());
    CURVISPLAT_CHECK(!stepValuesName(series, step, 0).empty());
  }
}

const RegisteredFuzzTarget steps_target("steps", fuzzSteps);

}  // namespace
}  // namespace curvisplat
