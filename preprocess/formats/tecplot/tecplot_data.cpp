#include "preprocess/formats/tecplot/tecplot_data.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/text_reader.h"
#include "stream/base/error.h"
#include "stream/base/threads.h"

namespace curvisplat {
namespace {

constexpr size_t kBufferBytes = size_t{256} << 10;

template <typename Stored, typename Value>
void convert(std::span<const std::byte> bytes, uint64_t stride, bool swap, std::span<Value> to) {
  for (size_t n = 0; n < to.size(); ++n)
    to[n] = convertedTo<Value>(loadStored<Stored>(bytes.data() + n * stride, swap));
}

}  // namespace

size_t bytesOf(TecplotType type) {
  switch (type) {
    case TecplotType::kDouble:
      return 8;
    case TecplotType::kInt16:
      return 2;
    case TecplotType::kByte:
      return 1;
    default:
      return 4;
  }
}

void checkTecplotCounts(const std::string& file, size_t zones, uint64_t variables) {
  constexpr uint64_t kMaxVariables = 1 << 16, kMaxArrays = 1 << 22;
  if (variables > kMaxVariables)
    throw Error("{}: has {} variables (expected at most {}); the file is damaged", file, variables,
                kMaxVariables);
  if (zones * variables > kMaxArrays)
    throw Error("{}: has {} variables in {} zones or more (at most {} in all are read); split the file", file,
                variables, zones, kMaxArrays);
}

template <typename Value>
void readTecplotValues(const TecplotValues& values, uint64_t first, std::span<Value> to) {
  static const PerThread<std::vector<std::byte>> buffers;
  std::vector<std::byte>& buffer = buffers.own();
  const size_t width = bytesOf(values.type);
  const auto most = static_cast<size_t>(std::max<uint64_t>(1, kBufferBytes / values.stride));
  for (size_t done = 0; done < to.size(); done += most) {
    const std::span<Value> part = to.subspan(done, std::min(most, to.size() - done));
    buffer.resize(std::max(kBufferBytes, width));
    const auto bytes =
        std::span(buffer).first(static_cast<size_t>((part.size() - 1) * values.stride + width));
    values.bytes->readAt(values.begin + (first + done) * values.stride, bytes);
    switch (values.type) {
      case TecplotType::kFloat:
        convert<float>(bytes, values.stride, values.swap, part);
        break;
      case TecplotType::kDouble:
        convert<double>(bytes, values.stride, values.swap, part);
        break;
      case TecplotType::kInt32:
        convert<int32_t>(bytes, values.stride, values.swap, part);
        break;
      case TecplotType::kInt16:
        convert<int16_t>(bytes, values.stride, values.swap, part);
        break;
      case TecplotType::kByte:
        convert<uint8_t>(bytes, values.stride, values.swap, part);
        break;
    }
  }
}

template void readTecplotValues(const TecplotValues&, uint64_t, std::span<float>);
template void readTecplotValues(const TecplotValues&, uint64_t, std::span<double>);

std::string TecplotZone::describe(size_t number) const {
  constexpr size_t kShown = 60;
  return fmt::format("zone {}{}", number + 1,
                     name.empty() ? "" : fmt::format(" ({})", printable(name.substr(0, kShown))));
}

void shareTecplotValues(const std::string& file, TecplotData& data, size_t from, size_t to, size_t variable) {
  const TecplotZone& zone = data.zones[to];
  if (from >= to)
    throw Error("{}: {} shares variable {} with zone {}; expected one of the zones before it", file,
                zone.describe(to), variable + 1, from + 1);
  if (data.zones[from].nodes != zone.nodes)
    throw Error("{}: {} shares variable {} with {}, which has other dimensions", file, zone.describe(to),
                variable + 1, data.zones[from].describe(from));
  data.zones[to].values[variable] = data.zones[from].values[variable];
}

void shareTecplotElements(const std::string& file, TecplotData& data, size_t from, size_t to) {
  TecplotZone& zone = data.zones[to];
  if (from >= to || data.zones[from].elements != zone.elements ||
      data.zones[from].element_nodes != zone.element_nodes || data.zones[from].of_faces != zone.of_faces ||
      data.zones[from].flat_elements != zone.flat_elements)
    throw Error(
        "{}: {} shares the elements of zone {}; expected one of the zones before it, with as many of the "
        "same kind",
        file, zone.describe(to), from + 1);
  zone.connectivity = data.zones[from].connectivity;
  zone.faces = data.zones[from].faces;
}

void setTecplotElements(const std::string& file, TecplotZone& zone, size_t number, const std::string& type) {
  struct Kind {
    std::string_view name;
    uint64_t nodes;
    bool flat;
  };
  constexpr Kind kKinds[] = {{"FETETRAHEDRON", 4, false}, {"FEBRICK", 8, false},  {"FEPOLYHEDRON", 0, false},
                             {"FEPOLYGON", 0, true},      {"FELINESEG", 2, true}, {"FETRIANGLE", 3, true},
                             {"FEQUADRILATERAL", 4, true}};
  const auto kind = std::find_if(std::begin(kKinds), std::end(kKinds), [&](const Kind& one) {
    return type == one.name || type == one.name.substr(2);
  });
  if (kind == std::end(kKinds))
    throw Error(
        "{}: is a Tecplot file whose {} is {}, a kind of elements that is not read; expected ORDERED, "
        "FETETRAHEDRON, FEBRICK or FEPOLYHEDRON",
        file, zone.describe(number), printable(type));
  zone.element_nodes = kind->nodes;
  zone.of_faces = kind->nodes == 0;
  if (kind->flat) zone.flat_elements = kind->name;
}

void checkTecplotZone(const std::string& file, const TecplotZone& zone, size_t number, uint64_t most) {
  const auto [ni, nj, nk] = zone.nodes;
  const TecplotFaces& faces = zone.faces;
  for (const uint64_t count : {faces.count, faces.corner_count, faces.connected, faces.connections})
    if (count > most)
      throw Error(
          "{}: {} declares {} faces or corners of them, more than a file of this size can hold; it is "
          "truncated or damaged",
          file, zone.describe(number), count);
  if (zone.of_faces && (faces.count == 0 || (faces.corner_count == 0 && zone.flat_elements.empty())))
    throw Error("{}: {} has no number of faces and of their corners (FACES and TOTALNUMFACENODES)", file,
                zone.describe(number));
  if (zone.elements > most)
    throw Error(
        "{}: {} declares {} elements, more than a file of this size can hold; it is truncated or damaged",
        file, zone.describe(number), zone.elements);
  if (ni > 0 && nj > 0 && nk > 0 && ni <= most && nj <= most / ni && nk <= most / ni / nj) return;
  throw Error(
      "{}: {} declares {}x{}x{} nodes, more than a file of this size can hold; it is truncated or damaged",
      file, zone.describe(number), ni, nj, nk);
}

}  // namespace curvisplat
