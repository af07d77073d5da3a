// Reads the tables of a cache and refuses invalid ones. After these checks every link of the octree is
// consistent, every extent lies inside its file and overlaps no other, and every number is finite. Code that
// uses the tables relies on that. This is where a damaged disk or a hostile cache is stopped.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "stream/base/file.h"
#include "stream/cache/manifest.h"
#include "stream/model/brick.h"

namespace curvisplat {

std::string variableFileName(const VariableInfo& variable);

/// Reads bricks.bin of the folder `cache`. Throws Error if it is inconsistent, or inconsistent with the
/// manifest.
std::vector<Brick> readBricks(const std::filesystem::path& cache, const Manifest& manifest);

/// Reads the table of a file of values; `info`: its entry in a manifest or in steps.bin. Throws Error as
/// readBricks().
std::vector<BrickVariable> readVariableTable(const InputFile& file, const FileInfo& info,
                                             std::span<const Brick> bricks);

/// Throws Error unless the manifest lists the file with its actual size. Returns the manifest's entry.
const FileInfo& checkFile(const InputFile& file, const Manifest& manifest);
const FileInfo& checkFile(const std::filesystem::path& path, uint64_t bytes, const Manifest& manifest);
/// Throws Error unless the file has the size that `info` states.
void checkSize(const std::filesystem::path& path, uint64_t bytes, const FileInfo& info);

/// The checksum of a geometry file: the checksum of its streams' checksums, in the order of bricks.bin.
uint64_t geometryChecksum(std::span<const Brick> bricks);

}  // namespace curvisplat
