// EnSight's case file, beside files that are as they should be: t.geo, t.geo0, t.geo1 (a tetrahedron), t.p, t.p00, t.p01 (a value for
// each node), t.u (a vector for each node) and t.c (a value for the cell).
#include "preprocess/formats/ensight/ensight_case.h"

#include <algorithm>
#include <string>

#include "preprocess/formats/ensight/ensight_source.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/grid_reading.h"

namespace curvisplat {
namespace {

bool writeFiles() {
  const auto write = [](const char* name, const std::string& text) {
    fuzzFile(name, std::as_bytes(std::span(text)));
  };
  const std::string part = "part\n1\n";
  const std::string points = "0\n1\n0\n0\n0\n0\n1\n0\n0\n0\n0\n1\n";
  const std::string geometry = "a\nb\nnode id off\nelement id off\n" + part +
                               "tetrahedron\ncoordinates\n4\n" + points + "tetra4\n1\n1 2 3 4\n";
  for (const char* name : {"t.geo", "t.geo0", "t.geo1"}) write(name, geometry);
  for (const char* name : {"t.p", "t.p00", "t.p01"}) write(name, "p\n" + part + "coordinates\n1\n2\n3\n4\n");
  write("t.u", "u\n" + part + "coordinates\n" + points);
  write("t.c", "c\n" + part + "tetra4\n5\n");
  return true;
}

void fuzzEnsightCase(std::span<const std::byte> bytes) {
  [[maybe_unused]] static const bool written = writeFiles();
  OpenGridOptions options;
  options.grid = fuzzFile("t.case", bytes);
  options.temporary_folder = fuzzFolder();
  if (!isEnsightCase(InputFile(options.grid))) return;
  const auto first = openEnsight(options);
  readData(*first);
  const auto steps = static_cast<uint32_t>(std::min<size_t>(first->description().times.size(), 4));
  for (uint32_t step = 1; step < steps; ++step) {
    options.time_step = step;
    readData(*openEnsight(options));
  }
}

const RegisteredFuzzTarget ensight_case_target("ensight_case", fuzzEnsightCase);

}  // namespace
}  // namespace curvisplat
