#include "preprocess/formats/gmsh/gmsh_parts.h"

#include <fmt/format.h>

#include <memory>
#include <set>
#include <string>

#include "preprocess/formats/common/byte_source.h"
#include "stream/base/error.h"

namespace curvisplat {

double readGmshFormat(GmshReader& reader) {
  std::string section = reader.requiredLine();
  for (; section == "$Comments"; section = reader.requiredLine()) reader.skipTo("$EndComments");
  if (!section.starts_with("$MeshFormat"))
    throw Error(
        "{}: has no $MeshFormat: it is of Gmsh's version 1; save it so (gmsh FILE -save -format msh41 -o "
        "OUT.msh)",
        reader.name());
  const double version = reader.textNumber(), binary = reader.textNumber(), bytes = reader.textNumber();
  if (version != 4.1 && version != 4 && version != 2 && version != 2.1 && version != 2.2)
    throw Error(
        "{}: is a Gmsh mesh of version {}; expected 4.1, 4.0 or 2.2: save it so (gmsh FILE -save -format "
        "msh41 "
        "-o OUT.msh)",
        reader.name(), version);
  if (binary == 1) {
    if (bytes != 8) reader.fail(fmt::format("has numbers of {} bytes; expected 8", bytes));
    reader.setBinary(false);
    reader.endLine();
    if (const auto one = reader.next<int32_t>(); one != 1) {
      if (byteSwapped(static_cast<uint32_t>(one)) != 1) reader.fail("has no 1 to tell its byte order");
      reader.setBinary(true);
    }
  }
  reader.skipTo("$EndMeshFormat");
  return version;
}

GmshPart readGmshPart(GmshReader& reader) {
  GmshPart part{0, reader.nextCount(true)};
  for (uint64_t ghosts = reader.nextCount(true); ghosts > 0; --ghosts)
    for (int n = 0; n < 2; ++n) reader.next<int32_t>();
  const uint64_t counts[] = {reader.nextCount(true), reader.nextCount(true), reader.nextCount(true),
                             reader.nextCount(true)};
  std::set<int32_t> of_volumes;
  for (size_t dimension = 0; dimension < 4; ++dimension)
    for (uint64_t entity = 0; entity < counts[dimension]; ++entity) {
      for (int n = 0; n < 3; ++n) reader.next<int32_t>();  // its number, and its parent
      for (uint64_t n = reader.nextCount(true); n > 0; --n)
        if (const auto partition = reader.next<int32_t>(); dimension == 3) of_volumes.insert(partition);
      for (int n = 0; n < (dimension == 0 ? 3 : 6); ++n) reader.next<double>();  // its bounds
      for (int list = 0; list < (dimension == 0 ? 1 : 2); ++list)  // physical groups and its boundary
        for (uint64_t n = reader.nextCount(true); n > 0; --n) reader.next<int32_t>();
    }
  if (of_volumes.size() != 1 || *of_volumes.begin() < 1) return {};
  part.part = static_cast<uint64_t>(*of_volumes.begin());
  return part;
}

uint64_t gmshParts(const std::filesystem::path& path) {
  GmshReader reader(std::make_shared<const PooledFile>(std::make_shared<OpenFiles>(), path));
  try {
    if (readGmshFormat(reader) != 4.1) return 1;
    while (const auto section = reader.line()) {
      if (*section == "$PartitionedEntities") return readGmshPart(reader).parts;
      if (*section == "$Nodes") break;
      reader.skipTo("$End" + section->substr(1));
    }
  } catch (const Error&) {
    return 1;  // reported where it is opened
  }
  return 1;
}

}  // namespace curvisplat
