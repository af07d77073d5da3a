// The markup of an XML file without its texts: what VTK's files hold between their tags is the data, of any
// size. The skeleton is small enough to be parsed whole, and has, for each text, where it lies.
#pragma once

#include <cstdint>
#include <string>

#include "preprocess/formats/common/open_files.h"

namespace curvisplat {

struct XmlSkeleton {
  /// Each text that is not white space is replaced by its first byte's position in the file and that behind
  /// its last, as "120 4711"; white space around it does not count. Comments are left out.
  std::string text;
  /// Where the data behind <AppendedData> begins, behind its underscore; 0: there is none. Nothing of the
  /// file is looked at from there on, since it need not be XML.
  uint64_t appended_begin = 0;
};

/// Reads the file up to its end, or to its <AppendedData>, through a buffer. Throws Error if the tags are not
/// nested, or if there are more of them than a few megabytes.
XmlSkeleton xmlSkeleton(const PooledFile& file);

}  // namespace curvisplat
