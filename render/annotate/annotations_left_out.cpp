// Annotations in a build without Cairo: pictures have none, and asking for one is an error.
#include "render/annotate/annotations.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

void refuse(const Annotations& annotations) {
  if (!(annotations == Annotations{}))
    throw UsageError(
        "this program was built without scalar bar, axes and outline (CMake's option "
        "CURVISPLAT_ANNOTATIONS)");
}

}  // namespace

bool hasAnnotations() {
  return false;
}

ImageSize dataSize(const Annotations& annotations, ImageSize picture,
                   std::span<const ShownFunction> /*functions*/) {
  refuse(annotations);
  return picture;
}

ImageSize dataSize(const Annotations& annotations, ImageSize picture, const TransferFunction& /*function*/) {
  refuse(annotations);
  return picture;
}

std::array<glm::dvec2, 3> axisNames(const AnnotatedScene& /*scene*/) {
  return {};
}

Image annotated(Image data, const Annotations& annotations, const AnnotatedScene& /*scene*/) {
  refuse(annotations);
  return data;
}

void putBehind(Image& /*picture*/, const Annotations& annotations, const AnnotatedScene& /*scene*/) {
  refuse(annotations);
}

uint64_t annotatedBytes(ImageSize /*picture*/, ImageSize /*data*/) {
  return 0;
}

std::vector<uint8_t> annotationLayer(const Annotations& annotations, const AnnotatedScene& scene) {
  refuse(annotations);
  return std::vector<uint8_t>(4 * scene.picture.pixels());
}

Image colourMapSheet() {
  throw UsageError(
      "this program was built without drawing text (CMake's option CURVISPLAT_ANNOTATIONS); leave out "
      "--output to list the maps");
}

}  // namespace curvisplat
