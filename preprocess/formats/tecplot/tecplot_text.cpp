#include "preprocess/formats/tecplot/tecplot_data.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/spool_file.h"
#include "preprocess/formats/common/text_reader.h"
#include "preprocess/formats/tecplot/tecplot_header.h"
#include "preprocess/formats/tecplot/tecplot_numbers.h"
#include "stream/base/disk_space.h"
#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr uint64_t kLooked = 2048;
constexpr size_t kMaxHeaderTokens = 1 << 20;
constexpr uint64_t kMaxDimension = uint64_t{1} << 40;

struct TextZone {
  bool point = false, has_packing = false, has_j = false;
  std::vector<bool> single;  // DT: [variable], as far as it goes
  std::optional<double> time;
  std::optional<int64_t> strand;
  std::vector<int64_t> shared;  // [variable]: the zone, from 0; -1: none
  int64_t elements_of = -1;     // the same of the elements
};

class Reader {
 public:
  Reader(std::shared_ptr<const PooledFile> file, const std::filesystem::path& folder)
      : file_(std::move(file)),
        folder_(folder),
        spool_(std::make_shared<SpoolFile>(folder)),
        text_(file_, 0, file_->size()) {}

  /// Takes what `index` knows of the numbers instead of counting them, or gives it to the index; null: neither.
  void use(FileIndex* index) {
    if (!index) return;
    index_ = index;
    version_ = FileVersion::of(file_->path());
    known_ = index->find(version_);
  }

  TecplotData run() {
    for (;;) {
      TecplotTokens tokens(takeHeader());
      if (tokens.done()) break;
      const bool data_of_zone = readRecords(tokens);
      const FilePart numbers = passNumbers();
      if (data_of_zone) placeValues(numbers);
    }
    placeEmpty();
    if (index_ && !known_) index_->keep(version_, std::move(passed_));
    data_.encoding = "ASCII";
    return std::move(data_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw Error("{}: {}, before byte {}", file_->name(), what, text_.offset());
  }
  [[noreturn]] void badValue(const std::string& key, const std::vector<TecplotToken>& value) const {
    std::string shown;
    for (const TecplotToken& token : value) shown += token.raw;
    fail(fmt::format("{} has the unknown value {} = {}", data_.zones.back().describe(data_.zones.size() - 1),
                     key, printable(shown.substr(0, 40))));
  }

  FilePart passNumbers() {
    if (known_ && passed_.size() < known_->size() && (*known_)[passed_.size()].begin == text_.offset()) {
      passed_.push_back((*known_)[passed_.size()]);
      text_.seek(passed_.back().end);
    } else {
      passed_.push_back(countTecplotNumbers(text_));
    }
    return passed_.back();
  }

  /// The tokens up to the next numbers.
  std::vector<TecplotToken> takeHeader() {
    std::vector<TecplotToken> tokens;
    int depth = 0;
    for (;;) {
      const std::string_view word = text_.peekWord();
      if (word.empty() || (depth <= 0 && beginsTecplotNumber(word))) return tokens;
      const auto line = text_.line();
      const size_t before = tokens.size();
      if (line) tokenizeTecplot(*line, tokens);
      for (size_t n = before; n < tokens.size(); ++n) {
        if (tokens[n].kind != TecplotToken::Kind::kSign) continue;
        if (tokens[n].text == "(" || tokens[n].text == "[") ++depth;
        if (tokens[n].text == ")" || tokens[n].text == "]") --depth;
      }
      if (tokens.size() > kMaxHeaderTokens) fail("has a header of more than a million words; it is damaged");
    }
  }

  /// Whether the numbers that follow belong to a zone.
  bool readRecords(TecplotTokens& tokens) {
    bool zone = false;
    while (!tokens.done()) {
      const TecplotToken record = tokens.pop();
      zone = record.text == "ZONE";
      if (zone) {
        placeEmpty();
        readZone(tokens);
      } else if (record.text == "VARIABLES") {
        readVariables(tokens);
      } else if (record.text == "FILETYPE") {
        tokens.takeSign('=');
        if (tokens.peek().text == "SOLUTION")
          throw Error(
              "{}: is a Tecplot file of solutions alone, which is not read; write the grid into the same "
              "file",
              file_->name());
      }
      while (!tokens.done() && !tokens.atRecord()) tokens.pop();
    }
    return zone;
  }

  void readVariables(TecplotTokens& tokens) {
    if (!data_.zones.empty()) fail("has a second list of variables after its first zone, which is not read");
    data_.variables.clear();
    tokens.takeSign('=');
    while (!tokens.done() && !tokens.atRecord()) {
      if (tokens.takeSign(',')) continue;
      data_.variables.push_back(tokens.pop().raw);
    }
  }

  void readZone(TecplotTokens& tokens) {
    if (data_.variables.empty()) fail("has no VARIABLES before its first zone");
    checkTecplotCounts(file_->name(), data_.zones.size() + 1, data_.variables.size());
    // A zone has one number or more of each variable that it does not share.
    if ((data_.zones.size() + 1) * data_.variables.size() > std::max<uint64_t>(file_->size(), 1024))
      fail("has more zones and variables than a file of its size can hold");
    TextZone& text = zones_.emplace_back();
    TecplotZone& zone = data_.zones.emplace_back();
    zone.values.resize(data_.variables.size());
    text.shared.assign(data_.variables.size(), -1);
    while (!tokens.done() && !tokens.atRecord()) {
      if (tokens.takeSign(',')) continue;
      const std::string key = tokens.pop().text;
      if (key == "AUXDATA") {
        tokens.pop();
        if (tokens.takeSign('=')) tokens.pop();
      } else if (tokens.takeSign('=')) {
        setKey(key, tokens.takeValue(), zone, text);
      }
    }
    // Tecplot before version 10, and FUN3D, give the counts of nodes and elements as I and J.
    if (zone.ofElements() && zone.elements == 0 && text.has_j) {
      zone.elements = zone.nodes[1];
      zone.nodes[1] = 1;
    }
    if (text.time && text.strand.value_or(1) != 0) zone.time = text.time;
    checkTecplotZone(file_->name(), zone, data_.zones.size() - 1, kMaxDimension);
    zone.first_node = 1;
    if ((zone.elements > 0) != zone.ofElements())
      fail("has a zone of finite elements without NODES, ELEMENTS and ZONETYPE");
  }

  void setKey(const std::string& key, const std::vector<TecplotToken>& value, TecplotZone& zone,
              TextZone& text) {
    const std::string word = value.empty() ? "" : value.front().text;
    const auto number = [&] {
      double parsed = 0;
      if (value.size() != 1 || !parseNumber(word, parsed)) badValue(key, value);
      return parsed;
    };
    const auto count = [&] {
      const double parsed = number();
      if (!(parsed >= 1 && parsed <= static_cast<double>(kMaxDimension))) badValue(key, value);
      return static_cast<uint64_t>(parsed);
    };
    const size_t index = data_.zones.size() - 1;
    if (key == "T") {
      zone.name = value.empty() ? "" : value.front().raw;
    } else if (key == "I" || key == "J" || key == "K" || key == "IMAX" || key == "JMAX" || key == "KMAX") {
      zone.nodes[static_cast<size_t>(key[0] - 'I')] = count();
      text.has_j = text.has_j || key[0] == 'J';
    } else if (key == "F" || key == "DATAPACKING") {
      if (!word.ends_with("POINT") && !word.ends_with("BLOCK")) badValue(key, value);
      text.point = word.ends_with("POINT");
      text.has_packing = true;
    } else if (key == "ZONETYPE") {
      if (word != "ORDERED") setTecplotElements(file_->name(), zone, index, word);
    } else if (key == "ET") {
      setTecplotElements(file_->name(), zone, index, word);
    } else if (key == "NODES" || key == "N") {
      zone.nodes[0] = count();
    } else if (key == "ELEMENTS" || key == "E") {
      zone.elements = count();
    } else if (key == "FACES") {
      zone.faces.count = count();
    } else if (key == "TOTALNUMFACENODES") {
      zone.faces.corner_count = count();
    } else if (key == "NUMCONNECTEDBOUNDARYFACES" || key == "TOTALNUMBOUNDARYCONNECTIONS") {
      (key[0] == 'N' ? zone.faces.connected : zone.faces.connections) = word == "0" ? 0 : count();
    } else if (key == "CONNECTIVITYSHAREZONE") {
      if (count() > index) badValue(key, value);
      text.elements_of = static_cast<int64_t>(count()) - 1;
    } else if (key == "SOLUTIONTIME") {
      text.time = number();
    } else if (key == "STRANDID") {
      text.strand = static_cast<int64_t>(std::clamp(number(), -2.0, 1e9));
    } else if (key == "DT") {
      text.single.clear();
      for (const TecplotToken& token : value)
        if (token.kind != TecplotToken::Kind::kSign) text.single.push_back(token.text == "SINGLE");
    } else if (key == "VARLOCATION") {
      setCentrings(key, value, zone);
    } else if (key == "PASSIVEVARLIST") {
      for (const auto& [numbers, unused] : sets(key, value))
        for (const size_t n : numbers) zone.values[n].passive = true;
    } else if (key == "VARSHARELIST" || key == "D") {
      setShared(key, value, text);
    }
  }

  TecplotSets sets(const std::string& key, const std::vector<TecplotToken>& value) const {
    auto found = tecplotSets(value, data_.variables.size());
    if (!found) badValue(key, value);
    return std::move(*found);
  }

  void setCentrings(const std::string& key, const std::vector<TecplotToken>& value, TecplotZone& zone) {
    const auto centring = [&](const std::string& word) {
      if (word != "CELLCENTERED" && word != "NODAL") badValue(key, value);
      return word == "CELLCENTERED" ? Centring::kCell : Centring::kNode;
    };
    if (!value.empty() && value.front().kind == TecplotToken::Kind::kWord &&
        !beginsTecplotNumber(value.front().text)) {
      size_t n = 0;  // (NODAL, NODAL, CELLCENTERED)
      for (const TecplotToken& token : value) {
        if (token.kind == TecplotToken::Kind::kSign) continue;
        if (n == zone.values.size()) badValue(key, value);
        zone.values[n++].centring = centring(token.text);
      }
      return;
    }
    for (const auto& [numbers, word] : sets(key, value))
      for (const size_t n : numbers) zone.values[n].centring = centring(word);
  }

  void setShared(const std::string& key, std::vector<TecplotToken> value, TextZone& text) {
    const size_t index = data_.zones.size() - 1;
    if (std::erase_if(value, [](const TecplotToken& token) { return token.text == "FECONNECT"; }) > 0 &&
        index > 0)
      text.elements_of = static_cast<int64_t>(index) - 1;
    for (const auto& [numbers, word] : sets(key, value)) {
      size_t from = index;  // from 1: without a number the previous zone
      if (!word.empty()) {
        const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), from);
        if (error != std::errc() || end != word.data() + word.size()) badValue(key, value);
      }
      if (from < 1 || from > index) badValue(key, value);
      for (const size_t n : numbers) text.shared[n] = static_cast<int64_t>(from) - 1;
    }
  }

  /// The last zone, if no numbers followed it: it shares all that it has.
  void placeEmpty() {
    if (placed_ < data_.zones.size()) placeValues({text_.offset(), text_.offset(), 0, 0});
  }

  /// The positions of the last zone's values in the spool file, which is filled when it is first read.
  void placeValues(const FilePart& numbers) {
    const uint64_t count = numbers.count;
    const size_t index = data_.zones.size() - 1;
    TecplotZone& zone = data_.zones[index];
    const TextZone& text = zones_[index];
    placed_ = data_.zones.size();
    std::vector<TecplotValues*> stored;
    bool cells = false;
    for (size_t n = 0; n < zone.values.size(); ++n) {
      if (text.shared[n] >= 0) {
        shareTecplotValues(file_->name(), data_, static_cast<size_t>(text.shared[n]), index, n);
      } else if (!zone.values[n].passive) {
        stored.push_back(&zone.values[n]);
        zone.values[n].from_single =
            numbers.digits <= kDigitsOfFloat || (n < text.single.size() && text.single[n]);
        cells = cells || zone.values[n].centring == Centring::kCell;
      }
    }
    const bool point = text.has_packing ? text.point : !cells;
    if (point && cells)
      fail(fmt::format("{} has values of cells by points; expected DATAPACKING=BLOCK", zone.describe(index)));
    const uint64_t nodes = zone.nodeCount();
    uint64_t expected = 0;
    for (TecplotValues* const values : stored) {
      values->type = TecplotType::kDouble;
      values->begin = 8 * expected;
      values->stride = point ? 8 * stored.size() : 8;
      const uint64_t less = values->centring == Centring::kCell ? 1 : 0;
      std::array<uint64_t, 3> along = zone.nodes;
      for (uint64_t& n : along) n = std::max<uint64_t>(1, n - less);
      if (zone.elements > 0) along = {less > 0 ? zone.elements : zone.nodes[0], 1, 1};
      values->row_pitch = along[0];
      values->columns = along[1];
      expected += point ? 1 : along[0] * along[1] * along[2];
    }
    if (point) expected = stored.size() * nodes;
    if (text.elements_of >= 0) {
      shareTecplotElements(file_->name(), data_, static_cast<size_t>(text.elements_of), index);
    } else if (zone.elements > 0) {
      TecplotFaces& faces = zone.faces;
      const auto place = [&](TecplotValues& values, uint64_t numbers) {
        stored.push_back(&values);
        values.type = TecplotType::kDouble;
        values.begin = 8 * expected;
        values.stride = 8;
        expected += numbers;
      };
      if (!zone.of_faces) {
        place(zone.connectivity, zone.elements * zone.element_nodes);
      } else {
        const bool flat = zone.flat();
        if (!flat) place(faces.sizes, faces.count);
        place(faces.corners, flat ? 2 * faces.count : faces.corner_count);
        place(faces.left, faces.count);
        place(faces.right, faces.count);
        expected += faces.connected + 2 * faces.connections;
      }
    }
    if (count < expected) failAtWord(count, expected);
    if (count != expected)
      throw Error("{}: {} has {} numbers; expected {}, for {} variables of {}x{}x{} nodes; {}", file_->name(),
                  zone.describe(index), count, expected, stored.size(), zone.nodes[0], zone.nodes[1],
                  zone.nodes[2],
                  count < expected ? "the file is truncated, or DATAPACKING is wrong"
                                   : "I, J, K, the list of variables or DATAPACKING is wrong");
    checkSpace(zone, index, count);
    const auto bytes = std::make_shared<SpooledBytes>(
        spool_, 8 * count,
        [file = file_, begin = numbers.begin, count = numbers.count](const SpoolFile::Sink& sink) {
          spoolTecplotNumbers(file, begin, count, sink);
        });
    for (TecplotValues* const values : stored) values->bytes = bytes;
  }

  /// Throws Error if what follows the numbers of the last zone is a word that begins no record.
  void failAtWord(uint64_t count, uint64_t expected) {
    const std::string word = printable(text_.peekWord().substr(0, 30));
    std::vector<TecplotToken> tokens;
    tokenizeTecplot(word, tokens);
    if (tokens.empty() || TecplotTokens(tokens).atRecord()) return;
    const uint64_t begin = text_.offset();
    uint64_t line = 1;
    for (TextReader before(file_, 0, begin); before.line() && before.offset() < begin;) ++line;
    throw Error("{}: line {} has \"{}\" after {} of the {} numbers of {}; expected a number", file_->name(),
                line, word, count, expected, data_.zones.back().describe(data_.zones.size() - 1));
  }

  /// Repeated numbers (1000000*0) may be more than the file.
  void checkSpace(const TecplotZone& zone, size_t index, uint64_t count) const {
    const std::optional<uint64_t> available = freeBytes(folder_);
    if (count > file_->size() && available && count > *available / 8)
      throw Error("{}: {} has {} numbers, too many for the {} bytes free in {}", file_->name(),
                  zone.describe(index), count, *available, folder_.string());
  }

  std::shared_ptr<const PooledFile> file_;
  std::filesystem::path folder_;
  std::shared_ptr<SpoolFile> spool_;
  TextReader text_;
  TecplotData data_;
  std::vector<TextZone> zones_;
  size_t placed_ = 0;  // zones
  FileIndex* index_ = nullptr;
  FileVersion version_;
  std::shared_ptr<const FileParts> known_;
  FileParts passed_;
};

}  // namespace

bool isTecplotText(const InputFile& file) {
  const std::string begin = beginningOf(file, kLooked);
  if (begin.find('\0') != std::string::npos) return false;
  for (size_t at = 0; at < begin.size();) {
    const size_t end = std::min(begin.find('\n', at), begin.size());
    std::vector<TecplotToken> tokens;
    tokenizeTecplot(std::string_view(begin).substr(at, end - at), tokens);
    at = end + 1;
    if (tokens.empty()) continue;
    TecplotTokens record(tokens);
    if (!record.atRecord()) return false;
    const std::string word = record.pop().text;
    if (word == "TITLE" || word == "VARIABLES" || word == "FILETYPE")
      return record.takeSign('=') ||
             (record.done() &&
              trimmed(std::string_view(begin).substr(std::min(at, begin.size()))).starts_with('='));
    return word == "ZONE" && !record.done() && record.peek().kind == TecplotToken::Kind::kWord;
  }
  return false;
}

TecplotData readTecplotText(const std::shared_ptr<const PooledFile>& file,
                            const std::filesystem::path& folder, FileIndex* index) {
  Reader reader(file, folder);
  reader.use(index);
  return reader.run();
}

}  // namespace curvisplat
