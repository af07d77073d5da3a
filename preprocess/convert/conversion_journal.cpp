#include "preprocess/convert/conversion_journal.h"

#include <fmt/chrono.h>
#include <sys/stat.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <charconv>
#include <limits>
#include <span>

#include "stream/base/checksum.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/json_document.h"

namespace curvisplat {

ScatterNotes timedNotes(std::chrono::milliseconds interval, const ScatterState* from,
                        const std::function<void(const ScatterState&)>& write) {
  using Clock = std::chrono::steady_clock;
  const auto next = std::make_shared<Clock::time_point>(Clock::now() + interval);
  return {from, [next] { return Clock::now() >= *next; },
          [=](const ScatterState& state) {
            const Clock::time_point begin = Clock::now();
            write(state);
            const Clock::time_point end = Clock::now();
            *next = end + std::max<Clock::duration>(interval, 20 * (end - begin));
          }};
}

std::unique_ptr<BucketFile> openScattered(const std::filesystem::path& file, const ScatteredSplats& left,
                                          const MemoryPlan& plan) {
  CURVISPLAT_CHECK(left.unfinished.has_value());
  const auto buckets = static_cast<uint32_t>(left.buckets.chains.size());
  if (left.unfinished->slab_bytes > plan.slab_bytes || left.buckets.chunk_bytes > plan.chunkBytes(buckets))
    throw LostBuckets("there is less --memory than before the interruption: all splats are made again");
  return std::make_unique<BucketFile>(file, left.buckets, BucketFile::Access::kAppend);
}

namespace {

using nlohmann::json;

// To be raised when the journal, temporary files or the bricks of a grid change.
constexpr int kJournalVersion = 8;
constexpr uint64_t kLargestJournal = uint64_t{1} << 30;

std::string checksumLine(const std::string& text) {
  return fmt::format("{:016x}\n", checksumOf(std::as_bytes(std::span(text))));
}

std::string factOfFile(const std::string& name) {
  struct stat status {};
  if (::stat(name.c_str(), &status) != 0) return name;  // a source need not be made of files
  std::error_code ignored;
  std::filesystem::path path = std::filesystem::canonical(name, ignored);
  if (path.empty()) path = name;
  return fmt::format("{} ({} bytes, modified {:%Y-%m-%d %H:%M:%S}.{:09} UTC)", path.string(), status.st_size,
                     fmt::gmtime(status.st_mtim.tv_sec), status.st_mtim.tv_nsec);
}

/// Names are bytes, which need not be the UTF-8 that JSON is: what is not plain goes as %XX.
std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20 || byte >= 0x7f || c == '%')
      out += fmt::format("%{:02x}", byte);
    else
      out += c;
  }
  return out;
}

std::string unescaped(const JsonField& field) {
  const std::string text = field.text();
  std::string out;
  for (size_t n = 0; n < text.size(); ++n) {
    if (text[n] != '%') {
      out += text[n];
      continue;
    }
    unsigned byte = 0;
    const char* const begin = text.data() + n + 1;
    if (n + 2 >= text.size() || std::from_chars(begin, begin + 2, byte, 16).ptr != begin + 2)
      field.fail("text with %XX for bytes");
    out += static_cast<char>(byte);
    n += 2;
  }
  return out;
}

uint32_t smallCount(const JsonField& field) {
  return static_cast<uint32_t>(field.count(0, std::numeric_limits<uint32_t>::max()));
}

json jsonOf(const glm::dvec3& vector) {
  return {vector.x, vector.y, vector.z};
}

json jsonOf(const GridSurvey& survey) {
  json ranges = json::array();
  for (const ScalarRange& range : survey.ranges) ranges.push_back({range.min, range.max});
  json lost = json::array();
  for (const BlankCounts::Lost& of_scalar : survey.blanked.lost)
    lost.push_back({of_scalar.samples, of_scalar.set});
  return {{"nodes", survey.nodes},
          {"grid_checksum", survey.grid_checksum},
          {"blanked", {survey.blanked.by_grid, survey.blanked.by_value, survey.blanked.not_finite}},
          {"lost", lost},
          {"lower", jsonOf(survey.lower)},
          {"upper", jsonOf(survey.upper)},
          {"ranges", ranges}};
}

GridSurvey surveyOf(const JsonField& from) {
  GridSurvey survey;
  survey.nodes = from.at("nodes").count();
  survey.grid_checksum = from.at("grid_checksum").count();
  const JsonField blanked = from.at("blanked");
  survey.blanked = {blanked[0].count(), blanked[1].count(), blanked[2].count(), {}};
  if (const auto lost = from.find("lost"))  // journals of older programs have none
    for (const JsonField& of_scalar : lost->elements())
      survey.blanked.lost.push_back({of_scalar[0].count(), of_scalar[1].count()});
  survey.lower = from.at("lower").point();
  survey.upper = from.at("upper").point();
  for (const JsonField& range : from.at("ranges").elements())
    survey.ranges.push_back({range[0].number(), range[1].number()});
  return survey;
}

/// A row a node: first child, bucket and, of a leaf that has splats, its contents.
json jsonOf(const BucketTree& tree) {
  json nodes = json::array();
  const std::vector<BucketTree::Link> links = tree.links();
  for (uint32_t node = 0; node < links.size(); ++node) {
    json row = {links[node].first_child, links[node].bucket};
    const CellContents& contents = tree[node].contents;
    if (tree[node].isLeaf() && contents.splats > 0) {
      row.push_back(contents.splats);
      for (const RootPosition& corner : {contents.lower, contents.upper})
        for (const uint64_t coordinate : corner.at) row.push_back(coordinate);
    }
    nodes.push_back(std::move(row));
  }
  return nodes;
}

/// Children come after their parent, and are no one else's: in the order in which the tree was split.
bool isTree(const std::vector<BucketTree::Link>& links, size_t buckets) {
  std::vector<uint32_t> level(links.size(), BucketTree::kNone);
  if (links.empty()) return false;
  level[0] = 0;
  for (size_t node = 0; node < links.size(); ++node) {
    const BucketTree::Link& link = links[node];
    const bool leaf = link.first_child == BucketTree::kNone;
    const bool possible = level[node] != BucketTree::kNone &&
                          (leaf ? link.bucket < buckets
                                : link.first_child > node && links.size() - link.first_child >= 8 &&
                                      link.first_child < links.size() && level[node] < kMaxLevel);
    if (!possible) return false;
    for (uint32_t octant = 0; !leaf && octant < 8; ++octant) {
      uint32_t& child = level[link.first_child + octant];
      if (child != BucketTree::kNone) return false;
      child = level[node] + 1;
    }
  }
  return true;
}

BucketTree treeOf(const JsonField& nodes, size_t buckets) {
  std::vector<BucketTree::Link> links;
  std::vector<CellContents> contents;
  for (const JsonField& row : nodes.elements()) {
    links.push_back({smallCount(row[0]), smallCount(row[1])});
    contents.emplace_back();
    if (row.size() == 2) continue;
    contents.back().splats = row[2].count();
    for (size_t axis = 0; axis < 3; ++axis) {
      contents.back().lower.at[axis] = row[3 + axis].count();
      contents.back().upper.at[axis] = row[6 + axis].count();
    }
  }
  if (!isTree(links, buckets)) nodes.fail("the nodes of a tree");
  BucketTree tree = BucketTree::fromLinks(links);
  tree.setContents(tree.leavesBelow(0), contents);
  return tree;
}

json jsonOf(const BucketChains& buckets) {
  json chains = json::array();
  for (const BucketChains::OfBucket& bucket : buckets.chains) {
    json& row = chains.emplace_back(bucket.last_chunks);
    row.push_back(bucket.bytes);
  }
  return {{"chunk_bytes", buckets.chunk_bytes}, {"size", buckets.size}, {"chains", chains}};
}

BucketChains bucketsOf(const JsonField& from) {
  BucketChains buckets{from.at("chunk_bytes").count(), from.at("size").count(), {}};
  for (const JsonField& row : from.at("chains").elements()) {
    BucketChains::OfBucket& bucket = buckets.chains.emplace_back();
    for (size_t n = 0; n < BucketChains::kCount; ++n) bucket.last_chunks[n] = row[n].count();
    bucket.bytes = row[BucketChains::kCount].count();
  }
  return buckets;
}

json jsonOf(const ScatterState& state) {
  json handedness = json::array();
  for (const Handedness& of_block : state.handedness) handedness.push_back({of_block.right, of_block.left});
  return {{"slab_bytes", state.slab_bytes},
          {"slabs", state.slabs},
          {"degenerate", state.degenerate},
          {"handedness", handedness}};
}

ScatterState stateOf(const JsonField& from) {
  ScatterState state{
      from.at("slab_bytes").count(), from.at("slabs").count(), from.at("degenerate").count(), {}};
  for (const JsonField& of_block : from.at("handedness").elements())
    state.handedness.push_back({of_block[0].count(), of_block[1].count()});
  return state;
}

json jsonOf(const std::vector<WallSide>& walls) {
  json boxes = json::array();
  for (const auto& [block, side, first, last] : walls)
    boxes.push_back({block, side, first[0], first[1], first[2], last[0], last[1], last[2]});
  return boxes;
}

json jsonOf(const ScatteredSplats& splats) {
  json of_ranks = json::array();
  for (const BucketChains& buckets : splats.buckets_of_ranks) of_ranks.push_back(jsonOf(buckets));
  json of_splats = {{"buckets_of_ranks", of_ranks},
                    {"survey", jsonOf(splats.survey)},
                    {"degenerate", splats.counts.degenerate},
                    {"inverted", splats.counts.inverted},
                    {"halved", splats.counts.halved},
                    {"hanging", splats.counts.hanging},
                    {"overlap", splats.overlap},
                    {"merged_nodes", splats.merged_nodes},
                    {"thin_walls", jsonOf(splats.thin_walls)},
                    {"sample", splats.sample_file},
                    {"tree", jsonOf(splats.tree)},
                    {"buckets", jsonOf(splats.buckets)}};
  if (splats.unfinished) of_splats["unfinished"] = jsonOf(*splats.unfinished);
  return of_splats;
}

ScatteredSplats splatsOf(const JsonField& from) {
  ScatteredSplats splats;
  splats.survey = surveyOf(from.at("survey"));
  splats.counts = {from.at("degenerate").count(), from.at("inverted").count(), from.at("halved").count(), 0};
  if (const auto hanging = from.find("hanging"))
    splats.counts.hanging = hanging->count();  // older programs fitted none
  splats.overlap = from.at("overlap").text();
  splats.merged_nodes = from.at("merged_nodes").count();
  if (const auto walls = from.find("thin_walls"))  // older programs kept none apart
    for (const JsonField& box : walls->elements())
      splats.thin_walls.push_back({smallCount(box[0]),
                                   smallCount(box[1]),
                                   {box[2].count(), box[3].count(), box[4].count()},
                                   {box[5].count(), box[6].count(), box[7].count()}});
  splats.sample_file = from.at("sample").text();
  splats.buckets = bucketsOf(from.at("buckets"));
  if (const auto ranks = from.find("buckets_of_ranks"))
    for (const JsonField& buckets : ranks->elements()) {
      splats.buckets_of_ranks.push_back(bucketsOf(buckets));
      if (splats.buckets_of_ranks.back().chains.size() != splats.buckets.chains.size())
        buckets.fail("as many chains as 'buckets'");
    }
  splats.tree = treeOf(from.at("tree"), splats.buckets.chains.size());
  if (const auto unfinished = from.find("unfinished")) splats.unfinished = stateOf(*unfinished);
  return splats;
}

ConversionJournal journalOf(const JsonField& content) {
  ConversionJournal journal;
  for (const JsonField& fact : content.at("facts").elements())
    journal.facts.push_back({unescaped(fact[0]), unescaped(fact[1])});
  journal.scratch = unescaped(content.at("scratch"));
  if (const auto splats = content.find("splats")) journal.splats = splatsOf(*splats);
  return journal;
}

}  // namespace

std::vector<ConversionFact> factsOf(const GridDescription& description, const std::vector<uint32_t>& scalars,
                                    std::optional<double> blank_value, Overlap overlap) {
  std::vector<ConversionFact> facts;
  facts.push_back(
      {"the program", fmt::format("curvisplat " CURVISPLAT_VERSION ", journal {}", kJournalVersion)});
  for (size_t n = 0; n < description.files.size(); ++n)
    facts.push_back({fmt::format("file {}", n + 1), factOfFile(description.files[n])});
  std::string names;
  for (const uint32_t scalar : scalars)
    names += (names.empty() ? "" : ", ") + description.scalars[scalar].name;
  uint64_t nodes = 0;
  for (const GridBlock& block : description.blocks) nodes += block.nodes();
  for (const MeshPiece& piece : description.pieces) nodes += piece.points;
  facts.push_back({"the layout", fmt::format("{}, {} nodes", description.format, nodes)});
  if (description.times.size() > 1) facts.push_back({"--time-step", std::to_string(description.time_step)});
  facts.push_back({"--scalar", names.empty() ? "none" : names});
  facts.push_back({"--blank", blank_value ? fmt::format("{}", *blank_value) : "none"});
  facts.push_back({"--overlap", overlap == Overlap::kAll ? kOverlapAll : kOverlapOwner});
  return facts;
}

std::string differenceOf(const std::vector<ConversionFact>& before, const std::vector<ConversionFact>& now) {
  for (size_t n = 0; n < std::min(before.size(), now.size()); ++n)
    if (before[n] != now[n])
      return before[n].what == now[n].what
                 ? fmt::format("{} has changed from {} to {}", now[n].what, before[n].value, now[n].value)
                 : fmt::format("its files have changed: {} was {}", before[n].what, before[n].value);
  return before.size() == now.size() ? "" : "the number of its files has changed";
}

std::string journalText(const ConversionJournal& journal) {
  json facts = json::array();
  for (const ConversionFact& fact : journal.facts) facts.push_back({escaped(fact.what), escaped(fact.value)});
  json content = {
      {"version", kJournalVersion}, {"facts", facts}, {"scratch", escaped(journal.scratch.string())}};
  if (journal.splats) content["splats"] = jsonOf(*journal.splats);
  const std::string text = content.dump() + "\n";
  return text + checksumLine(text);
}

void writeSample(const std::filesystem::path& scratch, ScatteredSplats& splats) {
  const auto bytes = std::as_bytes(std::span(splats.sample));
  // Another name for other contents: until the journal names it, the one before is needed.
  splats.sample_file = fmt::format("sample.{:016x}.bin", checksumOf(bytes));
  writeFileAtomically(scratch / splats.sample_file, bytes);
}

void readSample(const std::filesystem::path& scratch, ScatteredSplats& splats) {
  const InputFile file(scratch / splats.sample_file);
  splats.sample.resize(file.size() / sizeof(double));
  const auto bytes = std::as_writable_bytes(std::span(splats.sample));
  file.readAt(0, bytes);
  if (splats.sample_file != fmt::format("sample.{:016x}.bin", checksumOf(bytes)))
    throw Error("{}: is damaged", file.path().string());
}

void writeJournal(const std::filesystem::path& folder, const ConversionJournal& journal) {
  writeFileAtomically(folder / kJournalName, journalText(journal));
}

std::optional<ConversionJournal> readJournal(const std::filesystem::path& folder) {
  std::error_code error;  // a folder or a link of this name is the user's
  if (!std::filesystem::is_regular_file(std::filesystem::symlink_status(folder / kJournalName, error)))
    return std::nullopt;
  return journalFrom(readTextFile(folder / kJournalName, kLargestJournal));
}

std::optional<ConversionJournal> journalFrom(const std::string& bytes) {
  const size_t end = bytes.find('\n') + 1;  // 0 if there is none
  const std::string text = bytes.substr(0, end);
  if (bytes.substr(end) != checksumLine(text)) return std::nullopt;
  try {
    const JsonDocument document(text, kJournalName, "a journal");
    if (document.root().at("version").json() != kJournalVersion) return std::nullopt;
    return journalOf(document.root());
  } catch (const Error&) {
    // A text with the checksum of a journal's, and not one that this program has written.
    return std::nullopt;
  }
}

}  // namespace curvisplat
