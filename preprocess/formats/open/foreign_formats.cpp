#include "preprocess/formats/open/foreign_formats.h"

#include <algorithm>
#include <string_view>

namespace curvisplat {
namespace {

struct Magic {
  std::string_view bytes;
  const char* words;
};

using namespace std::string_view_literals;

constexpr Magic kMagics[] = {
    {"# vtk DataFile"sv, "a legacy VTK file"},
    {"<VTKFile"sv, "a VTK XML file"},
    {"<?xml"sv, "an XML file"},
    {"\x89HDF\r\n\x1a\n"sv, "an HDF5 file"},
    {"CDF\x01"sv, "a NetCDF file"},
    {"CDF\x02"sv, "a NetCDF file"},
    {"CDF\x05"sv, "a NetCDF file"},
    {"#!TDV"sv, "a Tecplot binary file, which is not read"},
    {"C Binary"sv, "an EnSight file, which is not read"},
    {"{"sv, "a JSON file: a .p3d description is given alone, in the grid's place"},
    {"\x89PNG"sv, "a PNG picture"},
    {"\xff\xd8\xff"sv, "a JPEG picture"},
    {"%PDF"sv, "a PDF document"},
    {"\x7f"
     "ELF"sv,
     "a program"},
    {"\x1f\x8b"sv, "compressed with gzip: unpack it first"},
    {"BZh"sv, "compressed with bzip2: unpack it first"},
    {"\xfd"
     "7zXZ"sv,
     "compressed with xz: unpack it first"},
    {"\x28\xb5\x2f\xfd"sv, "compressed with zstd: unpack it first"},
    {"PK\x03\x04"sv, "a zip archive: unpack it first"},
};

}  // namespace

std::optional<std::string> foreignFormat(const InputFile& file) {
  std::string begin(static_cast<size_t>(std::min<uint64_t>(file.size(), 64)), '\0');
  file.readAt(0, std::span(begin.data(), begin.size()));
  for (const Magic& magic : kMagics)
    if (begin.starts_with(magic.bytes)) return magic.words;
  // Its first four bytes differ between versions.
  if (begin.find("ADF Database") == 4) return "a CGNS (ADF) file";
  return std::nullopt;
}

}  // namespace curvisplat
