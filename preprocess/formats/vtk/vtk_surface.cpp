#include "preprocess/formats/vtk/vtk_surface.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "preprocess/formats/common/temporary_folder.h"
#include "preprocess/formats/vtk/vtk_xml_file.h"

namespace curvisplat {
namespace {

using XmlElement = pugi::xml_node;

constexpr uint64_t kSurfaceTuplesAtOnce = 65536;
constexpr uint64_t kMaxSurfacePoints = std::numeric_limits<uint32_t>::max();

/// Passes on the tuples of an array, some at a time, so that no more memory is taken than there is data.
template <typename Use>
void forTuples(const VtkArray& array, uint32_t components, const Use& use) {
  std::vector<std::vector<double>> values(components, std::vector<double>(kSurfaceTuplesAtOnce));
  for (uint64_t first = 0; first < array.tuples; first += kSurfaceTuplesAtOnce) {
    const uint64_t count = std::min(kSurfaceTuplesAtOnce, array.tuples - first);
    std::vector<WantedComponent<double>> wanted;
    for (uint32_t c = 0; c < components; ++c) wanted.push_back({static_cast<int>(c), values[c].data()});
    readTuples<double>(array, first, count, wanted);
    for (size_t n = 0; n < count; ++n) use(values, n);
  }
}

/// A piece of the file.
class PieceReader {
 public:
  PieceReader(const VtkXmlFile& file, const XmlElement& piece, VtkSurface& out)
      : file_(file), piece_(piece), out_(out), first_(out.points.size()) {}

  void read() {
    const uint64_t points = countOf("NumberOfPoints");
    if (points == 0) return;
    const VtkArray array = file_.array(piece_.child("Points").child("DataArray"), points);
    if (array.components != 3) file_.fail("its points do not have three coordinates");
    forTuples(array, 3, [&](const auto& values, size_t n) {
      const glm::dvec3 at(values[0][n], values[1][n], values[2][n]);
      if (!std::isfinite(at.x) || !std::isfinite(at.y) || !std::isfinite(at.z))
        file_.fail("a point's coordinates are not finite");
      out_.points.push_back(at);
    });
    readCells("Polys", countOf("NumberOfPolys"), false);
    readCells("Strips", countOf("NumberOfStrips"), true);
  }

 private:
  uint64_t countOf(const char* attribute) const {
    const uint64_t count = piece_.attribute(attribute).as_ullong(0);
    if (count > kMaxSurfacePoints) file_.fail(std::string(attribute) + " is too large");
    return count;
  }

  XmlElement arrayNamed(const XmlElement& cells, const std::string& name) const {
    for (const XmlElement& node : cells.children("DataArray"))
      if (name == node.attribute("Name").value()) return node;
    file_.fail("its cells have no array '" + name + "'");
  }

  void readCells(const char* element, uint64_t cells, bool strips) {
    if (cells == 0) return;
    const XmlElement node = piece_.child(element);
    std::vector<uint64_t> ends;
    forTuples(file_.array(arrayNamed(node, "offsets"), cells), 1, [&](const auto& values, size_t n) {
      const double end = values[0][n];
      if (!(end >= (ends.empty() ? 0.0 : static_cast<double>(ends.back())) && end <= 8.0 * kMaxSurfacePoints))
        file_.fail("the offsets of its cells do not increase");
      ends.push_back(static_cast<uint64_t>(end));
    });
    std::vector<uint32_t> corners;
    size_t cell = 0;
    uint64_t at = 0;
    const auto finish = [&] {
      for (; cell < ends.size() && ends[cell] == at; ++cell) {
        addCell(corners, strips);
        corners.clear();
      }
    };
    finish();
    forTuples(file_.array(arrayNamed(node, "connectivity"), ends.back()), 1,
              [&](const auto& values, size_t n) {
                const double point = values[0][n];
                if (!(point >= 0 && point < static_cast<double>(out_.points.size() - first_)))
                  file_.fail("a cell refers to a point that does not exist");
                corners.push_back(static_cast<uint32_t>(static_cast<uint64_t>(point) + first_));
                ++at;
                finish();
              });
  }

  void addCell(const std::vector<uint32_t>& corners, bool strip) {
    for (size_t n = 2; n < corners.size(); ++n)
      out_.triangles.push_back({strip ? corners[n - 2] : corners[0], corners[n - 1], corners[n]});
  }

  const VtkXmlFile& file_;
  const XmlElement& piece_;
  VtkSurface& out_;
  const uint64_t first_;  // of the piece's points
};

}  // namespace

VtkSurface readVtkSurface(const std::filesystem::path& path) {
  const VtkXmlFile file(VtkFiles(systemTemporaryFolder()), path);
  if (file.type() != "PolyData")
    file.fail("is a VTK file of type " + file.type() + "; a surface is a .vtp file, of type PolyData");
  VtkSurface surface;
  for (const XmlElement& piece : file.content().children("Piece")) PieceReader(file, piece, surface).read();
  if (surface.points.size() > kMaxSurfacePoints) file.fail("has too many points");
  if (surface.triangles.empty()) file.fail("has no polygons");
  return surface;
}

}  // namespace curvisplat
