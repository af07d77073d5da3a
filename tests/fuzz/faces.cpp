// A file of faces. Checksums are made right here, of the table and of the streams that it names.
//
//   the bytes of faces.bin
#include "stream/cache/faces_file.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "stream/base/check.h"
#include "stream/base/checksum.h"
#include "tests/fuzz/fuzz_target.h"

namespace curvisplat {
namespace {

/// The checksum that a manifest would have; 0 where there is no table. Puts those of streams into the table.
uint64_t makeRight(std::vector<std::byte>& file) {
  FacesHeader header;
  if (file.size() < sizeof header) return 0;
  std::memcpy(&header, file.data(), sizeof header);
  if (header.table_offset > file.size()) return 0;
  const uint64_t patches = header.table_offset + uint64_t{header.variables} * sizeof(uint32_t) +
                           uint64_t{header.faces} * sizeof(FaceRecord);
  for (uint64_t n = 0; n < header.patches; ++n) {
    const uint64_t at = patches + n * sizeof(PatchRecord);
    if (at + sizeof(PatchRecord) > file.size()) break;
    PatchRecord record;
    std::memcpy(&record, file.data() + at, sizeof record);
    if (record.offset > file.size() || record.length > file.size() - record.offset) continue;
    record.checksum = checksumOf(std::span(file).subspan(record.offset, record.length));
    std::memcpy(file.data() + at, &record, sizeof record);
  }
  Checksum checksum;
  checksum.add(std::span(file).first(sizeof header));
  checksum.add(std::span(file).subspan(header.table_offset));
  return checksum.value();
}

void fuzzFaces(std::span<const std::byte> bytes) {
  std::vector<std::byte> file(bytes.begin(), bytes.end());
  const uint64_t checksum = makeRight(file);
  Manifest manifest;
  manifest.files = {{kFacesFileName, file.size(), checksum}};
  fuzzFile(kFacesFileName, file);
  const auto faces = FacesReader::open(fuzzFolder(), manifest);
  for (uint32_t n = 0; n < faces->patches().size(); ++n) {
    const FacePatch& patch = faces->patches()[n];
    const PatchNodes nodes = faces->read(n);
    CURVISPLAT_CHECK_OP(nodes.positions.size(), ==, patch.nodeCount());
    CURVISPLAT_CHECK_OP(nodes.quads.size(), ==, patch.quadCount());
    for (const glm::dvec3& at : nodes.positions)
      CURVISPLAT_CHECK(std::isfinite(at.x) && std::isfinite(at.y) && std::isfinite(at.z));
    for (const std::vector<float>& scalar : nodes.scalars)
      for (const float value : scalar) CURVISPLAT_CHECK(std::isfinite(value));
  }
}

const RegisteredFuzzTarget faces_target("faces", fuzzFaces);

}  // namespace
}  // namespace curvisplat
