#include "preprocess/formats/ensight/ensight_values.h"

#include <algorithm>
#include <limits>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

class ValuesReader {
 public:
  ValuesReader(const EnsightVariable& variable, const EnsightGeometry& geometry,
               const std::filesystem::path& folder)
      : variable_(variable),
        geometry_(geometry),
        file_(std::make_shared<const PooledFile>(std::make_shared<OpenFiles>(), variable.file),
              geometry.binary, folder) {
    file_.setSwap(geometry.swap);
  }

  std::vector<EnsightValues> run();

 private:
  void readPart(size_t part);
  /// Where the values under a keyword belong, and how many they are.
  std::pair<size_t, uint64_t> placeOf(const EnsightPart& part, const std::string& keyword) const;

  const EnsightVariable& variable_;
  const EnsightGeometry& geometry_;
  EnsightFile file_;
  std::string next_;
  std::vector<EnsightValues> values_;
};

std::pair<size_t, uint64_t> ValuesReader::placeOf(const EnsightPart& part, const std::string& keyword) const {
  const bool nodes = variable_.centring == Centring::kNode;
  if (part.structured && keyword == "block") return {0, nodes ? part.points : part.cells};
  if (!part.structured && nodes && keyword == "coordinates") return {0, part.points};
  if (!part.structured && !nodes)
    for (size_t n = 0; n < part.elements.size(); ++n)
      if (part.elements[n].type == keyword) return {n, part.elements[n].count};
  throw Error("{}: has '{}' in part {}; expected {}; the file is damaged, or of another geometry",
              file_.name(), printable(keyword.substr(0, 40)), part.number,
              part.structured ? "'block'"
              : nodes         ? "'coordinates'"
                              : "one of the part's types of elements");
}

void ValuesReader::readPart(size_t number) {
  const EnsightPart& part = geometry_.parts[number];
  EnsightValues& values = values_[number];
  for (next_ = file_.keyword(); !next_.empty() && next_ != "part"; next_ = file_.keyword()) {
    std::string keyword = next_;
    const size_t space = keyword.find(' ');
    const std::string how =
        space == std::string::npos ? "" : keyword.substr(keyword.find_first_not_of(' ', space));
    keyword.resize(std::min(space, keyword.size()));
    const auto [list, count] = placeOf(part, keyword);
    if (values.lists.size() <= list) {
      values.lists.resize(list + 1);
      values.undefined.resize(list + 1, std::numeric_limits<double>::quiet_NaN());
    }
    if (how == "undef")
      values.undefined[list] = file_.valuesOf(file_.floats(1))[0];
    else if (!how.empty())
      throw Error("{}: has '{}' values in part {}, which are not read; expected values everywhere",
                  file_.name(), printable(how.substr(0, 40)), part.number);
    values.lists[list] = file_.floats(count * variable_.components);
  }
}

std::vector<EnsightValues> ValuesReader::run() {
  values_.resize(geometry_.parts.size());
  file_.text();  // description
  next_ = file_.keyword();
  while (!next_.empty()) {
    const uint64_t number = next_ == "part" ? file_.integer() : 0;
    const auto found = std::find_if(geometry_.parts.begin(), geometry_.parts.end(),
                                    [&](const EnsightPart& part) { return part.number == number; });
    if (next_ != "part" || found == geometry_.parts.end())
      throw Error("{}: has '{}' {} where a part of the geometry is expected; the file is damaged",
                  file_.name(), printable(next_.substr(0, 40)), number);
    readPart(static_cast<size_t>(found - geometry_.parts.begin()));
  }
  file_.finish();
  return std::move(values_);
}

}  // namespace

std::vector<EnsightValues> readEnsightValues(const EnsightVariable& variable, const EnsightGeometry& geometry,
                                             const std::filesystem::path& folder) {
  return ValuesReader(variable, geometry, folder).run();
}

}  // namespace curvisplat
