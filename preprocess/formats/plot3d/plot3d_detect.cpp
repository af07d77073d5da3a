#include "preprocess/formats/plot3d/plot3d_detect.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "preprocess/formats/common/text_reader.h"
#include "preprocess/formats/plot3d/plot3d_file.h"
#include "preprocess/formats/plot3d/plot3d_fit.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

// A layout is judged by some of the values that it gives: are they coordinates or fields, or noise? Read
// with the wrong byte order or precision, most numbers are extreme, or differ from their neighbour along i
// by many powers of two, since their exponents are arbitrary bits. Numbers of a field do so in few places.
constexpr double kNoiseBelow = 1e-36, kNoiseAbove = 1e30;
// Doubles that are rounding errors of zero may be as small as 1e-48 and less; bits of another order reach 1e-300.
constexpr double kNoiseBelowOfDoubles = 1e-100;
constexpr double kNoiseJump = 65536;
constexpr double kUsualSize = 1e12;
constexpr double kNoiseShare = 0.25;
constexpr int32_t kLargestIblank = 1'000'000;  // iblank values are at most block or grid numbers

/// Up to 8 blocks spread over the file.
std::vector<uint32_t> sampleBlocks(size_t blocks) {
  std::vector<uint32_t> sample;
  const size_t step = std::max<size_t>(1, blocks / 8);
  for (size_t b = 0; b < blocks; b += step) sample.push_back(static_cast<uint32_t>(b));
  return sample;
}

/// Rows along i, at most `most`, spread over a block.
std::vector<NodeBox> sampleRows(const Plot3dBlock& block, uint64_t most) {
  const uint64_t rows = block.nj * block.nk;
  const uint64_t step = std::max<uint64_t>(1, rows / most);
  std::vector<NodeBox> boxes;
  for (uint64_t row = 0; row < rows && boxes.size() < most; row += step)
    boxes.push_back({row % block.nj, row % block.nj + 1, row / block.nj, row / block.nj + 1});
  return boxes;
}

bool isExtreme(double value, const Plot3dLayout& layout) {
  const double size = std::abs(value);
  // Text has neither byte order nor precision to doubt: a small number is one.
  const double noise_below = layout.ascii                  ? 0
                             : layout.precision_bytes == 8 ? kNoiseBelowOfDoubles
                                                           : kNoiseBelow;
  return size != 0 && (size < noise_below || size > kNoiseAbove);
}

/// Whether numbers look like noise instead of a field.
class NoiseTest {
 public:
  explicit NoiseTest(const Plot3dLayout& layout) : layout_(layout) {}
  /// The next number begins a row.
  void beginRow() { before_ = 0; }
  void add(std::span<const double> values) {
    for (const double value : values) {
      if (!std::isfinite(value)) continue;
      const double size = std::abs(value);
      ++finite_;
      if (isExtreme(value, layout_)) {
        ++extreme_;
        extreme_value_ = value;
      }
      if (size != 0 && before_ != 0) jumps_ += size > kNoiseJump * before_ || before_ > kNoiseJump * size;
      largest_ = std::max(largest_, size);
      before_ = size;
    }
  }
  /// An example of the numbers if they look like noise; nullopt if they look like a field.
  std::optional<double> example() const {
    const double limit = kNoiseShare * static_cast<double>(finite_);
    // Among numbers of usual magnitude, tiny ones are rounding errors of zero.
    if (largest_ > kUsualSize && static_cast<double>(jumps_) > limit) return largest_;
    if (static_cast<double>(extreme_) > limit) return extreme_value_;
    return std::nullopt;
  }

 private:
  const Plot3dLayout& layout_;
  uint64_t finite_ = 0, extreme_ = 0, jumps_ = 0;
  double largest_ = 0, before_ = 0, extreme_value_ = 0;
};

/// Pieces of a row to be read one at a time: rows may be long, and memory is planned only once the format is
/// known.
std::vector<NodeBox> piecesOf(const NodeBox& row, uint64_t ni) {
  constexpr uint64_t kPieceNodes = 1 << 16;
  std::vector<NodeBox> pieces;
  for (uint64_t i = 0; i < ni; i += kPieceNodes) {
    NodeBox& piece = pieces.emplace_back(row);
    piece.i0 = i;
    piece.i1 = std::min(i + kPieceNodes, ni);
  }
  return pieces;
}

/// nullopt if the values are plausible; else a description of the problem. Reads some rows of some blocks.
/// Throws Error if reading fails.
std::optional<std::string> implausibility(const Plot3dFit& fit) {
  const Plot3dFile file(fit);
  std::vector<double> values(1);
  file.read(0, 0, {0, 1, 0, 1, 0, 1}, values);
  if (isExtreme(values.front(), fit.layout))
    return fmt::format("its values begin with {}, as if its header were longer", values.front());
  std::vector<int32_t> iblank;
  const std::vector<uint32_t> blocks = sampleBlocks(fit.blocks.size());
  for (const uint32_t b : blocks) {
    const uint64_t ni = fit.blocks[b].ni;
    const std::vector<NodeBox> rows = sampleRows(fit.blocks[b], 64 / blocks.size());
    for (uint32_t component = 0; component < fit.components; ++component) {
      NoiseTest noise(fit.layout);
      for (const NodeBox& row : rows) {
        noise.beginRow();
        for (const NodeBox& piece : piecesOf(row, ni)) {
          values.resize(piece.rowNodes(ni));
          file.read(b, component, piece, values);
          noise.add(values);
        }
      }
      if (const std::optional<double> example = noise.example())
        return fmt::format("many values of component {} of block {} are like {}", component + 1, b + 1,
                           *example);
    }
    if (!fit.layout.blanking) continue;
    for (const NodeBox& row : rows)
      for (const NodeBox& piece : piecesOf(row, ni)) {
        iblank.resize(piece.rowNodes(ni));
        file.readIblank(b, piece, iblank);
        for (const int32_t value : iblank)
          if (value > kLargestIblank || value < -kLargestIblank)
            return fmt::format("block {} has an iblank of {}", b + 1, value);
      }
  }
  return std::nullopt;
}

/// Whether the bytes after coordinates without iblank could be the beginning of an iblank array, which would
/// mean that the file is truncated.
bool trailingLooksLikeIblank(const Plot3dFit& fit) {
  const uint64_t width = fit.layout.integerBytes();
  if (fit.layout.kind != Plot3dKind::kGrid || fit.layout.blanking ||
      fit.layout.records != RecordMarkers::kNone || fit.trailing_bytes < width)
    return false;
  Plot3dFit behind = fit;  // reads the trailing bytes as the iblank of a one-row block
  const uint64_t count = std::min<uint64_t>(fit.trailing_bytes / width, 1024);
  behind.blocks = {{count, 1, 1, fit.payload.size() - fit.trailing_bytes}};
  behind.components = 0;
  behind.layout.blanking = true;
  std::vector<int32_t> values(count);
  Plot3dFile(behind).readIblank(0, {0, 1, 0, 1}, values);
  const bool small = std::all_of(values.begin(), values.end(),
                                 [](int32_t v) { return v <= kLargestIblank && v >= -kLargestIblank; });
  return small && std::any_of(values.begin(), values.end(), [](int32_t v) { return v != 0; });
}

bool looksLikeText(const InputFile& file) {
  std::array<char, 4096> bytes;
  const auto count = static_cast<size_t>(std::min<uint64_t>(bytes.size(), file.size()));
  file.readAt(0, std::span(bytes.data(), count));
  return std::all_of(bytes.begin(), bytes.begin() + static_cast<ptrdiff_t>(count),
                     [](char c) { return (c >= ' ' && c <= '~') || (c >= '\t' && c <= '\r'); });
}

/// The options that would decide between the layouts.
std::string decidingOptions(const std::vector<Plot3dFit>& fits) {
  const auto differ = [&](const auto& of) {
    return std::any_of(fits.begin(), fits.end(),
                       [&](const Plot3dFit& f) { return of(f) != of(fits.front()); });
  };
  std::string options;
  const auto add = [&](bool needed, const char* option) {
    if (needed) options += (options.empty() ? "" : ", ") + std::string(option);
  };
  add(differ([](const Plot3dFit& f) { return f.layout.byte_order; }), "--byte-order");
  add(differ([](const Plot3dFit& f) { return f.layout.records; }), "--records");
  add(differ([](const Plot3dFit& f) { return f.layout.precision_bytes; }), "--precision");
  add(differ([](const Plot3dFit& f) { return f.layout.multi_block; }), "--blocks");
  add(differ([](const Plot3dFit& f) { return f.layout.blanking; }), "--iblank");
  return options;
}

std::string kindsText(const std::vector<Plot3dKind>& kinds) {
  std::string words;
  for (const Plot3dKind kind : kinds) words += (words.empty() ? "" : " or ") + curvisplat::describe(kind);
  return words;
}

/// The detection of the layout of one file.
class Detection {
 public:
  Detection(std::shared_ptr<const InputFile> file, const Plot3dForce& force,
            const std::filesystem::path& temporary_folder, std::vector<Plot3dKind> kinds)
      : path_(file->path().string()), force_(force) {
    if (file->size() == 0) throw Error("{}: is empty; expected a PLOT3D {}", path_, kindsText(kinds));
    CURVISPLAT_CHECK(!force.precision_bytes || *force.precision_bytes == 4 || *force.precision_bytes == 8);
    file_size_ = file->size();
    candidates_ = {file, file_size_, force.ascii.value_or(looksLikeText(*file)), std::move(kinds), force};
    if (!candidates_.ascii) return;
    const AsciiSpool spool = spoolAscii(*file, temporary_folder);
    candidates_.file = spool.doubles;
    candidates_.size = spool.count * sizeof(double);
    digits_ = spool.significant_digits;
  }

  /// `grid_path` and `grid_blocks`: null for a grid.
  DetectedPlot3d run(const std::filesystem::path* grid_path, const std::vector<Plot3dBlock>* grid_blocks) {
    Plot3dFits found = fitPlot3d(candidates_);
    if (found.fits.empty()) failUnfit(found.misfits, grid_blocks);
    if (grid_blocks) keepMatching(found.fits, *grid_blocks);
    keepExact(found.fits);
    keepThreeDimensional(found.fits);
    if (grid_blocks && !matches(found.fits.front(), *grid_blocks))
      failMismatch(found.fits.front(), *grid_path, *grid_blocks);
    keepPlausible(found.fits);
    if (found.fits.size() > 1) failAmbiguous(found.fits);
    Plot3dFit& fit = found.fits.front();
    if (fit.trailing_bytes > 0 && !force_.blanking && trailingLooksLikeIblank(fit))
      throw Error(
          "{}: {} of {} is followed by {} bytes that look like a truncated iblank; get the complete file, or "
          "read it without iblank (--iblank no)",
          path_, curvisplat::describe(fit.layout), curvisplat::describe(fit.blocks), fit.trailing_bytes);
    const int precision = writtenPrecision(fit.layout);
    return {std::move(fit), precision};
  }

 private:
  int writtenPrecision(const Plot3dLayout& layout) const {
    if (!layout.ascii) return layout.precision_bytes;
    return force_.precision_bytes.value_or(digits_ > kDigitsOfFloat ? 8 : 4);
  }

  static bool matches(const Plot3dFit& fit, const std::vector<Plot3dBlock>& grid_blocks) {
    return !fit.layout.two_dimensional && sameDimensions(fit.blocks, grid_blocks);
  }

  /// Drops fits without the grid's dimensions, if any has them.
  static void keepMatching(std::vector<Plot3dFit>& fits, const std::vector<Plot3dBlock>& grid_blocks) {
    const auto suits = [&](const Plot3dFit& fit) { return matches(fit, grid_blocks); };
    if (std::any_of(fits.begin(), fits.end(), suits))
      std::erase_if(fits, [&](const Plot3dFit& fit) { return !suits(fit); });
  }

  [[noreturn]] void failMismatch(const Plot3dFit& fit, const std::filesystem::path& grid_path,
                                 const std::vector<Plot3dBlock>& grid_blocks) const {
    throw Error("{}: is a {} of {}, but the grid {} has {}; use a solution of the same grid", path_,
                curvisplat::describe(fit.layout.kind), curvisplat::describe(fit.blocks), grid_path.string(),
                curvisplat::describe(grid_blocks));
  }

  static bool sameDimensions(const std::vector<Plot3dBlock>& a, const std::vector<Plot3dBlock>& b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const Plot3dBlock& p, const Plot3dBlock& q) {
      return p.ni == q.ni && p.nj == q.nj && p.nk == q.nk;
    });
  }

  static void keepExact(std::vector<Plot3dFit>& fits) {
    const auto exact = [](const Plot3dFit& fit) { return fit.trailing_bytes == 0; };
    if (std::any_of(fits.begin(), fits.end(), exact))
      std::erase_if(fits, [&](const Plot3dFit& fit) { return !exact(fit); });
  }

  void keepThreeDimensional(std::vector<Plot3dFit>& fits) const {
    const auto flat = [](const Plot3dFit& fit) { return fit.layout.two_dimensional; };
    if (std::all_of(fits.begin(), fits.end(), flat))
      throw Error("{}: is a 2-D {} ({}); only 3-D files are read", path_,
                  curvisplat::describe(fits.front().layout.kind), curvisplat::describe(fits.front().layout));
    std::erase_if(fits, flat);
  }

  /// A single fit of a solution with the grid's dimensions and the exact size is accepted whatever its
  /// values, since fields may contain fill values and denormal numbers.
  void keepPlausible(std::vector<Plot3dFit>& fits) const {
    const bool solution = fits.front().layout.kind != Plot3dKind::kGrid;
    if (fits.size() == 1 && solution && fits.front().trailing_bytes == 0) return;
    if (force_.byte_order && force_.precision_bytes && force_.records) return;
    std::vector<Plot3dFit> kept;
    std::string reason;
    for (const Plot3dFit& fit : fits) {
      if (const auto implausible = implausibility(fit))
        reason = fmt::format("{} of {} fits in size, but {}", curvisplat::describe(fit.layout),
                             curvisplat::describe(fit.blocks), *implausible);
      else
        kept.push_back(fit);
    }
    if (kept.empty())
      throw Error("{}: has implausible values: {}; {}", path_, reason,
                  fits.front().layout.ascii ? "is it a PLOT3D file?"
                                            : "set the layout with --byte-order, --records and --precision");
    fits = std::move(kept);
  }

  [[noreturn]] void failAmbiguous(const std::vector<Plot3dFit>& fits) const {
    std::string layouts;
    for (const Plot3dFit& fit : fits)
      layouts +=
          fmt::format("{}{} of {} ({})", layouts.empty() ? "" : "; ", curvisplat::describe(fit.layout.kind),
                      curvisplat::describe(fit.blocks), curvisplat::describe(fit.layout));
    throw Error("{}: fits {} layouts equally well: {}; choose one with {}", path_, fits.size(), layouts,
                decidingOptions(fits));
  }

  [[noreturn]] void failUnfit(std::vector<Plot3dMisfit> misfits,
                              const std::vector<Plot3dBlock>* grid_blocks) const {
    if (!grid_blocks) refuseSolution();
    const std::string expected = kindsText(candidates_.kinds);
    const auto rank = [&](const Plot3dMisfit& misfit) {
      const bool of_grid = grid_blocks && sameDimensions(misfit.blocks, *grid_blocks);
      const bool markers_agree = misfit.layout.records != RecordMarkers::kNone;
      return 4 * misfit.reached + 2 * of_grid + markers_agree;
    };
    const auto furthest = std::max_element(misfits.begin(), misfits.end(),
                                           [&](const auto& a, const auto& b) { return rank(a) < rank(b); });
    std::string finding = "no header of plausible dimensions was found";
    if (furthest != misfits.end() && furthest->reached >= LayoutMisfit::kFirstRecord) {
      finding = fmt::format("read as {} {}: {}", describeAttempt(furthest->layout),
                            curvisplat::describe(furthest->layout.kind), furthest->reason);
    }
    throw Error("{}: its {} bytes fit no PLOT3D {}: {}{}", path_, file_size_, expected, finding, hint());
  }

  /// Refuses a solution in place of a grid by name. Some files end with a few bytes of padding; more may be a truncated grid.
  void refuseSolution() const {
    constexpr uint64_t kMaxPadding = 1024;
    Plot3dCandidates others = candidates_;
    others.kinds = {Plot3dKind::kQ, Plot3dKind::kOverflow, Plot3dKind::kFunction};
    others.force = {};
    for (const Plot3dFit& fit : fitPlot3d(others).fits)
      if (fit.trailing_bytes <= kMaxPadding && !fit.layout.two_dimensional)
        throw Error("{}: looks like a solution without its grid (a {} of {}, {}); choose its grid, too{}",
                    path_, curvisplat::describe(fit.layout.kind), curvisplat::describe(fit.blocks),
                    curvisplat::describe(fit.layout), gridBeside());
  }

  /// The name of a file beside the solution that is its grid by the name, in parentheses; empty without one.
  std::string gridBeside() const {
    for (const char* const ending : {".xyz", ".x", ".g", ".grd", ".grid"}) {
      const auto grid = std::filesystem::path(path_).replace_extension(ending);
      std::error_code ignored;
      if (grid != path_ && std::filesystem::is_regular_file(grid, ignored))
        return fmt::format(" (perhaps {})", grid.filename().string());
    }
    return {};
  }

  /// Describes only the properties that are decided before sizes are compared.
  static std::string describeAttempt(const Plot3dLayout& layout) {
    std::string words = layout.ascii                           ? "ASCII"
                        : layout.byte_order == ByteOrder::kBig ? "big-endian"
                                                               : "little-endian";
    if (!layout.ascii) words += layout.records == RecordMarkers::kNone ? " C" : " Fortran";
    return words + (layout.multi_block ? " multi-block" : " single-block");
  }

  /// A layout that fits if the user's options are ignored, or as another kind of file.
  std::string hint() const {
    Plot3dCandidates others = candidates_;
    others.kinds = {Plot3dKind::kGrid, Plot3dKind::kQ, Plot3dKind::kOverflow, Plot3dKind::kFunction};
    others.force = {};
    const Plot3dFits found = fitPlot3d(others);
    for (const Plot3dFit& fit : found.fits)
      if (fit.trailing_bytes == 0 && !fit.layout.two_dimensional)
        return fmt::format("; it would fit as a {} of {}, {}", curvisplat::describe(fit.layout.kind),
                           curvisplat::describe(fit.blocks), curvisplat::describe(fit.layout));
    return "";
  }

  std::string path_;
  uint64_t file_size_ = 0;
  Plot3dForce force_;
  Plot3dCandidates candidates_;
  int digits_ = 0;
};

}  // namespace

DetectedPlot3d detectPlot3dGrid(std::shared_ptr<const InputFile> file, const Plot3dForce& force,
                                const std::filesystem::path& temporary_folder) {
  return Detection(std::move(file), force, temporary_folder, {Plot3dKind::kGrid}).run(nullptr, nullptr);
}

DetectedPlot3d detectPlot3dSolution(std::shared_ptr<const InputFile> file, const Plot3dForce& force,
                                    const std::filesystem::path& temporary_folder,
                                    const std::filesystem::path& grid_path,
                                    const std::vector<Plot3dBlock>& grid_blocks) {
  return Detection(std::move(file), force, temporary_folder,
                   {Plot3dKind::kQ, Plot3dKind::kOverflow, Plot3dKind::kFunction})
      .run(&grid_path, &grid_blocks);
}

}  // namespace curvisplat
