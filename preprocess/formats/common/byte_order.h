// In which order the bytes of a number lie in a file.
#pragma once

namespace curvisplat {

enum class ByteOrder { kLittle, kBig };

}  // namespace curvisplat
