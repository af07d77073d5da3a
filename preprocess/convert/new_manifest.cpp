#include "preprocess/convert/conversion.h"

#include <cmath>

#include "preprocess/grid/grid_source.h"
#include "stream/cache/manifest.h"
#include "stream/model/thin_walls.h"

namespace curvisplat {

void reportCache(const Manifest& written, ConvertReport& report) {
  report.centring = written.cells ? Centring::kCell : Centring::kNode;
  report.nodes = written.nodes;
  report.splats = written.splats;
  report.bricks = written.bricks;
  report.levels = written.levels;
  report.volume = written.volume;
  for (const FileInfo& file : written.files) report.files.push_back({file.name, file.size});
}

std::vector<VariableInfo> variablesOf(const GridDescription& description, std::span<const uint32_t> scalars,
                                      const GridSurvey& survey) {
  std::vector<VariableInfo> variables;
  for (size_t n = 0; n < scalars.size(); ++n) {
    const GridScalar& scalar = description.scalars[scalars[n]];
    variables.push_back(
        {static_cast<uint32_t>(n), scalar.name, scalar.unit, survey.ranges[n].min, survey.ranges[n].max});
  }
  return variables;
}

Manifest manifestOf(const SplatOrigin& origin, const ConvertOptions& options, const ScatteredSplats& splats) {
  const GridDescription& description = origin.description();
  const GridSurvey& survey = splats.survey;
  Manifest manifest;
  manifest.title = options.title.empty() ? options.output.filename().string() : options.title;
  manifest.program = "curvisplat " CURVISPLAT_VERSION;
  manifest.sources = description.files;
  manifest.reader = description.format;
  if (options.blank_value) manifest.reader += fmt::format(", blank value {}", *options.blank_value);
  manifest.lower = survey.lower;
  manifest.upper = survey.upper;
  for (const GridBlock& block : origin.blocks())
    manifest.blocks.push_back({block.name, block.ni, block.nj, block.nk});
  if (splats.counts.halved > 0) manifest.blocks.front().nk = 2;
  manifest.requirements = {kBorderFaces, kCellGrowth, kMergedBorders, kFaceLayers, kPlates};
  if (options.precision == ValuePrecision::kFine) manifest.requirements.push_back(kFineValues);
  if (options.precision == ValuePrecision::kAuto) manifest.requirements.push_back(kScaledValues);
  if (origin.cutsOctants() && survey.blanked.total() > 0) manifest.requirements.push_back(kCellOctants);
  if (!splats.thin_walls.empty()) manifest.requirements.push_back(kThinWalls);
  manifest.overlap = splats.overlap;
  manifest.cells = origin.centring() == Centring::kCell;
  if (manifest.cells && description.pieces.empty()) manifest.requirements.push_back(kBorderPairs);
  if (description.pieces.empty()) manifest.stretch = kCellWidths;
  if (splats.counts.hanging > 0) manifest.stretch = kHangingNodes;
  manifest.refinement = description.refinement;
  manifest.globe = description.globe;
  manifest.nodes = survey.nodes;
  manifest.blanked_nodes = survey.blanked.total();
  manifest.grid_checksum = survey.grid_checksum;
  manifest.variables = variablesOf(description, options.scalars, survey);
  StepInfo step;
  step.time = options.time ? *options.time : statedTime(description).value_or(0);
  if (!std::isfinite(step.time)) step.time = 0;  // of one step it does not matter
  manifest.time_unit = options.time_unit ? options.time_unit->name : description.time_unit;
  manifest.calendar = options.time_unit ? options.time_unit->calendar : description.calendar;
  for (const VariableInfo& variable : manifest.variables) step.variables.push_back(variable.number);
  manifest.steps = {step};
  return manifest;
}

}  // namespace curvisplat
