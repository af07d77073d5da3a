// The markup of an XML file without the text between the tags, which in VTK files is data of any size. The
// skeleton is small enough to be parsed as a whole. It contains the position of each text instead.
#pragma once

#include <cstdint>
#include <string>

#include "preprocess/formats/common/open_files.h"

namespace curvisplat {

struct XmlSkeleton {
  /// The markup. Each text is replaced by the positions in the file of its first byte and after its last one,
  /// as "120 4711", not counting white space around it. White space between tags and comments are dropped.
  std::string text;
  /// Position of the first byte after the underscore of <AppendedData>; 0: there is none. The file is not
  /// scanned beyond it, since the data need not be XML.
  uint64_t appended_begin = 0;
};

/// Scans the file up to its end, or to its <AppendedData>, through a buffer. Throws Error if the tags are not
/// properly nested, or if they have more than 16 MiB.
XmlSkeleton xmlSkeleton(const PooledFile& file);

}  // namespace curvisplat
