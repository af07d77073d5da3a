// Grids whose picture is known: the reference's words (functions, cameras) in the renderer's, a grid's way
// through the real conversion and the real renderer inside this process, and the arguments of `render` for
// the half-annulus.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "preprocess/grid/grid_source.h"
#include "render/camera/camera.h"
#include "render/frame/frame.h"
#include "tests/reference/reference_march.h"

namespace curvisplat {

/// One of the transfer functions of DESIGN.md, "Fidelity" (smooth, band, step), over any range of the scalar and
/// for data of any size, in the words of the reference and of the renderer.
struct KnownFunction {
  OpticalFunction exact;
  TransferFunction table;

  /// [low, high] takes the place of [0, 1]; optical depths are as if `length` world units were one.
  static KnownFunction of(const std::string& name, double low = 0, double high = 1, double length = 1);
};

/// A camera that looks along the layers of half-annulus: they are seen edge-on.
Camera edgeOnCamera();
/// halfAnnulusCamera() in perspective: the focal plane is seen as large, under `view_angle_deg`.
Camera perspectiveCamera(double view_angle_deg = 30);

/// The reference of half-annulus with one of the functions, as halfAnnulusCamera() sees it; marched once a
/// process.
const Image& knownReference(const std::string& function, ImageSize size);

/// Converts the scalar at `scalar` of the source's description to `cache`, over what is there.
void convertGrid(const GridSource& source, const std::filesystem::path& cache, uint32_t scalar = 0);

/// Options of a frame over white, by the processor's painter, at the finest level.
FrameOptions knownFrame(ImageSize size);

/// Draws the only variable of a cache. `splats` gets how many were drawn.
Image drawCache(const std::filesystem::path& cache, const TransferFunction& function, const Camera& camera,
                const FrameOptions& options, uint64_t* splats = nullptr, Backend backend = Backend::kCpu);

/// The arguments of `render` for the picture of the half-annulus in DESIGN.md, "Fidelity": the test data's
/// function half_annulus_<function>.json, every pixel classified, over white.
std::vector<std::string> halfAnnulusWords(const std::string& cache, const std::string& output,
                                          const std::string& function, ImageSize size,
                                          const std::string& lod_pixels);

}  // namespace curvisplat
