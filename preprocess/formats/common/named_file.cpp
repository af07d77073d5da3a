#include "preprocess/formats/common/named_file.h"

#include <string>
#include <system_error>

#include "stream/base/error.h"
#include "stream/base/paths.h"

namespace curvisplat {

const std::filesystem::path& existingFile(std::string_view who, const std::filesystem::path& path) {
  if (isRegularFile(path)) return path;
  std::error_code ignored;
  if (std::filesystem::exists(path, ignored))
    throw Error("{} names {}, which is not a regular file", who, path.string());
  for (const char* const ending : {".gz", ".xz", ".zst"})
    if (const std::filesystem::path packed = path.string() + ending; isRegularFile(packed))
      throw Error("{} names {}, which does not exist; decompress {}", who, path.string(),
                  packed.filename().string());
  throw Error("{} names {}, which does not exist", who, path.string());
}

}  // namespace curvisplat
