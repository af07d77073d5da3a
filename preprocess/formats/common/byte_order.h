// The byte order of numbers in a file.
#pragma once

namespace curvisplat {

enum class ByteOrder { kLittle, kBig };

}  // namespace curvisplat
