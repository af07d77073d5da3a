// Reads the tables of a cache and refuses whatever cannot be: afterwards every link of the octree leads where
// it should, every extent lies in its file and apart from the others, and every number is finite. What a
// damaged disk or a hostile file could do to the program, it would have to do here.
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

/// bricks.bin of the folder `cache`, checked in itself and against the manifest. Throws Error.
std::vector<Brick> readBricks(const std::filesystem::path& cache, const Manifest& manifest);

/// The table of a var.<number>.bin. Throws Error.
std::vector<BrickVariable> readVariableTable(const InputFile& file, const Manifest& manifest,
                                             std::span<const Brick> bricks);

/// Throws Error unless the manifest lists the file with the size it has.
const FileInfo& checkFile(const InputFile& file, const Manifest& manifest);
const FileInfo& checkFile(const std::filesystem::path& path, uint64_t bytes, const Manifest& manifest);

/// The checksum of a geometry file: that of its bricks' checksums, in the order of bricks.bin.
uint64_t geometryChecksum(std::span<const Brick> bricks);

}  // namespace curvisplat
