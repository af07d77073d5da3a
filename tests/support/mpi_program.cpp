#include "tests/support/mpi_program.h"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>

namespace curvisplat {
namespace {

const std::string& mpirun() {
  static const std::string found = [] {
    const std::string path = std::getenv("PATH") ? std::getenv("PATH") : "";
    for (size_t begin = 0; begin <= path.size();) {
      const size_t end = std::min(path.find(':', begin), path.size());
      const std::string candidate = path.substr(begin, end - begin) + "/mpirun";
      if (::access(candidate.c_str(), X_OK) == 0) return candidate;
      begin = end + 1;
    }
    return std::string();
  }();
  return found;
}

}  // namespace

std::string whyNoRanks() {
  if (mpirun().empty()) return "mpirun is not in PATH (Debian: openmpi-bin)";
  const auto plug_in = std::filesystem::path(CURVISPLAT_PROGRAM).parent_path() / "curvisplat-mpi.so";
  if (!std::filesystem::exists(plug_in)) return "built without MPI (CMake's option CURVISPLAT_MPI)";
  return "";
}

ProgramResult runAsRanks(unsigned count, const std::vector<std::string>& arguments,
                         const std::string& program) {
  std::vector<std::string> words{
      "--oversubscribe", "--allow-run-as-root", "-q", "-n", std::to_string(count), program};
  words.insert(words.end(), arguments.begin(), arguments.end());
  return RunningProgram(words, mpirun()).wait();
}

}  // namespace curvisplat
