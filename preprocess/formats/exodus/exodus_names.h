// The names that SEACAS gives to the Exodus files of a run: a file for each mesh and, where several processors write, for each of them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace curvisplat {

/// "mesh.e-s002.16.03": what processor 3 of 16 wrote after the mesh of the run mesh.e changed.
struct ExodusName {
  std::string run;                    // "mesh.e"
  std::optional<uint64_t> processor;  // from 0
  uint64_t processors = 1;
  bool goes_on = false;  // has -s and a number
};

ExodusName exodusName(const std::filesystem::path& path);

/// A warning to a user who opens this Exodus file alone, about the others in its folder; empty if there are none.
std::string noteOnOtherExodusFiles(const std::filesystem::path& path);

}  // namespace curvisplat
