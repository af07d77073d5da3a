#include "preprocess/formats/open/unpacked_source.h"

#include "stream/base/error.h"
#include "stream/base/paths.h"

namespace curvisplat {
namespace {

using Unpacked = std::vector<std::unique_ptr<UnpackedFile>>;

void replaceAll(std::string& text, const std::string& from, const std::string& to) {
  for (size_t at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size()))
    text.replace(at, from.size(), to);
}

/// Names of decompressed files become those of the compressed ones.
std::string withOriginals(std::string text, const Unpacked& files) {
  // Backwards: a later file's path may begin like an earlier one's.
  for (auto file = files.rbegin(); file != files.rend(); ++file)
    replaceAll(text, (*file)->path().string(), (*file)->original().string());
  return text;
}

class UnpackedSource final : public GridSource {
 public:
  UnpackedSource(Unpacked files, std::unique_ptr<GridSource> source)
      : files_(std::move(files)), source_(std::move(source)), description_(source_->description()) {
    for (std::string& file : description_.files) file = withOriginals(file, files_);
    for (std::string& warning : description_.warnings) warning = withOriginals(warning, files_);
    for (FlowConditions& flow : description_.flow) flow.file = withOriginals(flow.file, files_);
    description_.format += ", decompressed";
  }

  const GridDescription& description() const override { return description_; }

  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    try {
      source_->read(block, box, scalars, out);
    } catch (const Error& error) {
      throw Error("{}", withOriginals(error.what(), files_));
    }
  }

 private:
  Unpacked files_;
  std::unique_ptr<GridSource> source_;
  GridDescription description_;
};

}  // namespace

std::unique_ptr<GridSource> openUnpacked(
    OpenGridOptions options, const std::function<std::unique_ptr<GridSource>(const OpenGridOptions&)>& open) {
  Unpacked files;
  const auto unpack = [&](std::filesystem::path& path) {
    if (!isRegularFile(path) || !UnpackedFile::recognises(InputFile(path))) return;
    files.push_back(std::make_unique<UnpackedFile>(path, options.temporary_folder));
    path = files.back()->path();
  };
  unpack(options.grid);
  for (std::filesystem::path& solution : options.solutions) unpack(solution);
  if (files.empty()) return open(options);
  std::unique_ptr<GridSource> source;
  try {
    source = open(options);
  } catch (const Error& error) {
    throw Error("{}", withOriginals(error.what(), files));
  }
  for (const auto& file : files) file->removeName();
  return std::make_unique<UnpackedSource>(std::move(files), std::move(source));
}

}  // namespace curvisplat
