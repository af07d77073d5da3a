#include "preprocess/formats/gmsh/gmsh_data.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

namespace curvisplat {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr uint64_t kRecordsAtOnce = 65536, kSamplesAtOnce = 1 << 20;
constexpr uint64_t kMaxNodesOfElement = 1331;

/// The values of some samples, [sample * components + component], from the sample `first` on.
struct Part {
  uint64_t first = 0, count = 0, components = 1;
  std::vector<double> values;
  std::vector<uint32_t> added;  // [sample]: how many values of elements at this node are in the sum

  /// The values of a sample; empty if it is not of this part.
  std::span<double> at(uint64_t sample) {
    if (sample < first || sample - first >= count) return {};
    return std::span(values).subspan((sample - first) * components, components);
  }
};

/// Some records of a section: of each the number of its node or element, and its values.
struct Records {
  std::vector<uint64_t> numbers;
  std::vector<size_t> begins{0};  // [record + 1], in the values
  std::vector<double> values;
};

void readRecords(GmshReader& reader, const GmshData& data, uint64_t count, Records& out) {
  out = {};
  for (uint64_t n = 0; n < count; ++n) {
    out.numbers.push_back(reader.nextTag(false));
    const uint64_t tuples = data.at_nodes_of_elements ? reader.nextCount(false) : 1;
    if (tuples > kMaxNodesOfElement) reader.fail(fmt::format("has values of {} nodes of an element", tuples));
    for (uint64_t k = 0; k < tuples * data.components; ++k) out.values.push_back(reader.next<double>());
    out.begins.push_back(out.values.size());
  }
}

void set(Part& part, uint64_t sample, std::span<const double> values) {
  const std::span<double> to = part.at(sample);
  if (!to.empty()) std::copy(values.begin(), values.end(), to.begin());
}

/// Adds the values that an element has at its nodes to theirs.
void addElement(const GmshReader& reader, std::span<const uint64_t> nodes, std::span<const double> values,
                Part& part) {
  if (values.size() != nodes.size() * part.components)
    reader.fail(fmt::format("has values of {} nodes for an element of {}", values.size() / part.components,
                            nodes.size()));
  for (size_t n = 0; n < nodes.size(); ++n) {
    const std::span<double> to = part.at(nodes[n]);
    if (to.empty()) continue;
    const bool is_first = part.added[nodes[n] - part.first]++ == 0;
    for (size_t c = 0; c < to.size(); ++c) to[c] = values[n * part.components + c] + (is_first ? 0 : to[c]);
  }
}

void addSection(GmshReader& reader, const GmshData& data, const GmshSamples& samples, Part& part) {
  const bool by_nodes = data.centring == Centring::kNode && !data.at_nodes_of_elements;
  Records records;
  reader.seek(data.offset);
  for (uint64_t n = 0; n < data.count; n += kRecordsAtOnce) {
    readRecords(reader, data, std::min(kRecordsAtOnce, data.count - n), records);
    (by_nodes ? samples.nodes : samples.elements).replace(records.numbers);
    for (size_t k = 0; k < records.numbers.size(); ++k) {
      const auto values = std::span<const double>(records.values)
                              .subspan(records.begins[k], records.begins[k + 1] - records.begins[k]);
      const uint64_t index = records.numbers[k];
      if (index == GmshTags::kNowhere) continue;
      if (data.at_nodes_of_elements)
        addElement(reader, samples.nodesOf(index), values, part);
      else
        set(part, index, values);
    }
  }
}

}  // namespace

bool hasGmshData(const std::string& section) {
  return section == "NodeData" || section == "ElementData" || section == "ElementNodeData";
}

GmshData readGmshData(GmshReader& reader, const std::string& section) {
  GmshData data;
  data.centring = section == "ElementData" ? Centring::kCell : Centring::kNode;
  data.at_nodes_of_elements = section == "ElementNodeData";
  const auto countOf = [&](const char* what) {
    const double count = reader.textNumber();
    if (!(count >= 0 && count <= 1000)) reader.fail(fmt::format("counts {} {}", count, what));
    return static_cast<size_t>(count);
  };
  for (size_t n = countOf("names"); n > 0; --n) {
    const std::string words = reader.requiredLine();
    if (data.name.empty()) data.name = words;
  }
  std::erase(data.name, '"');
  const size_t reals = countOf("times");
  for (size_t n = 0; n < reals; ++n)
    if (const double real = reader.textNumber(); n == 0) data.time = real;
  const size_t integers = countOf("sizes");
  std::vector<double> sizes(std::max<size_t>(3, integers));
  for (size_t n = 0; n < integers; ++n) sizes[n] = reader.textNumber();
  if (integers < 3 || !(sizes[1] >= 1 && sizes[1] <= 9) ||
      !(sizes[2] >= 0 && sizes[2] <= static_cast<double>(reader.size())))
    reader.fail(fmt::format("has values of {} components for {} samples", sizes[1], sizes[2]));
  reader.endLine();
  data.step = sizes[0];
  data.components = static_cast<uint64_t>(sizes[1]);
  data.count = static_cast<uint64_t>(sizes[2]);
  data.offset = reader.offset();
  if (reader.isBinary()) {
    const uint64_t bytes =
        data.count * (data.at_nodes_of_elements ? 8 : 4 + 8 * data.components);  // at least
    if (bytes > reader.size() - std::min(reader.size(), data.offset)) reader.fail("ends within values");
    reader.seek(data.offset + bytes);
  }
  if (data.name.empty()) data.name = section;
  return data;
}

SpooledNumbers spooledGmshData(GmshReader& reader, const std::vector<const GmshData*>& sections,
                               const GmshSamples& samples) {
  const bool of_nodes = sections.front()->centring == Centring::kNode;
  const uint64_t all = (of_nodes ? samples.nodes : samples.elements).count();
  NumberSpool<double> spool(samples.spool);
  Part part;
  part.components = sections.front()->components;
  for (; part.first < all; part.first += part.count) {
    part.count = std::min(kSamplesAtOnce, all - part.first);
    part.values.assign(part.count * part.components, kNaN);
    part.added.assign(part.count, 0);
    for (const GmshData* data : sections) addSection(reader, *data, samples, part);
    for (size_t n = 0; n < part.values.size(); ++n)
      spool.add(part.values[n] / std::max(1U, part.added[n / part.components]));
  }
  return spool.finish();
}

}  // namespace curvisplat
