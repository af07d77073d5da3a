// Stands in for image_jpeg.cpp in a build without libjpeg.
#include "render/image/image_file.h"
#include "stream/base/error.h"

namespace curvisplat {

ImageSize sizeOfJpeg(std::span<const std::byte>, const std::string& name) {
  throw Error("{}: is a JPEG image, which this build cannot read (CURVISPLAT_SERVER=OFF); save it as PNG",
              name);
}

Image decodeJpeg(std::span<const std::byte> bytes, const std::string& name) {
  return Image(sizeOfJpeg(bytes, name));
}

}  // namespace curvisplat
