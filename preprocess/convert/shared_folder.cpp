#include "preprocess/convert/shared_folder.h"

#include <string>
#include <vector>

#include "stream/base/error.h"
#include "stream/base/file.h"

namespace curvisplat {

std::filesystem::path sharedFolder(const std::filesystem::path& folder, Ranks& ranks) {
  std::string name;
  if (ranks.isFirst()) name = std::filesystem::absolute(folder).string();
  const auto sent = fromBytes<char>(ranks.broadcast(toBytes(std::vector<char>(name.begin(), name.end()))));
  const std::filesystem::path shared(std::string(sent.begin(), sent.end()));
  if (!std::filesystem::is_directory(shared))
    throw Error("{}: does not exist here; several ranks need a file system that they share", shared.string());
  return shared;
}

std::filesystem::path makeFolderOfRank(const std::filesystem::path& shared, unsigned rank) {
  const std::filesystem::path own = shared / fmt::format("rank{}", rank);
  removeAll(own);
  makeFolder(own);
  return own;
}

}  // namespace curvisplat
