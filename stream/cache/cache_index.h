// Opens the files of a cache safely and reads its tables, refusing invalid ones. A cache may come from
// anyone: this is where a damaged disk or a hostile cache is stopped.
//
// After these checks every link of the octree is consistent, every extent lies inside its file and overlaps
// no other, and every number is finite. Code that uses the tables relies on that. Tables are read a piece at
// a time, so that a sparse file cannot claim memory. Any thread may call the functions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "stream/base/file.h"
#include "stream/cache/manifest.h"
#include "stream/model/octree.h"

namespace curvisplat {

/// The path of the file `name` (a plain file name) in the folder `cache`, checked before it is opened.
/// Throws Error if it is a symbolic link, which may lead out of the folder, or exists but is not a regular
/// file: opening a pipe may block forever.
std::filesystem::path cacheFile(const std::filesystem::path& cache, const std::string& name);

/// The path of the folder `name` in the folder `cache`. Throws Error if it is a link, or not a folder.
std::filesystem::path cacheFolder(const std::filesystem::path& cache, const std::string& name);

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
/// Reads a file that the manifest lists as a whole. Throws Error if it has another size or checksum, or more than `most` bytes.
std::vector<std::byte> readListed(const std::filesystem::path& cache, const std::string& name,
                                  const Manifest& manifest, uint64_t most);
/// Throws Error unless the file has the size that `info` states.
void checkSize(const std::filesystem::path& path, uint64_t bytes, const FileInfo& info);

/// The checksum of a geometry file: the checksum of its streams' checksums, in the order of bricks.bin.
uint64_t geometryChecksum(std::span<const Brick> bricks);

}  // namespace curvisplat
