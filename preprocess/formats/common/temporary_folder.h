// The folder of temporary files where the user names none. Any thread.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>
#include <system_error>

#include "stream/base/error.h"

namespace curvisplat {

/// $TMPDIR, or /tmp. Throws Error that names the variable unless it is a folder.
inline std::filesystem::path systemTemporaryFolder() {
  std::error_code error;
  std::filesystem::path folder = std::filesystem::temp_directory_path(error);
  if (!error) return folder;
  for (const char* const name : {"TMPDIR", "TMP", "TEMP", "TEMPDIR"})
    if (const char* const value = std::getenv(name))
      throw Error("{}={}: {}; set {} to a directory for temporary files, or unset it", name, value,
                  error.message(), name);
  throw Error("/tmp: {}; set TMPDIR to a directory for temporary files", error.message());
}

}  // namespace curvisplat
