// Chooses files in the window. Our own: Debian has no library for it, and those in the desktop's own style
// ask programs that a cluster's login node does not have.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "render/image/image.h"
#include "tools/window/window.h"

namespace curvisplat {

/// An entry of a folder.
struct FolderEntry {
  std::string name;
  bool is_folder = false;  // to go into; a cache and a grid's folder are none
  uint64_t bytes = 0;
};

/// Whether a folder is a grid's, to be opened as a file is.
using IsGridFolder = std::function<bool(const std::filesystem::path& folder)>;

/// Folders first, by name, without those that begin with a dot; files with one of the endings, or all
/// if there are none. Where .splats is one of them, data is chosen: caches and grids' folders, compressed files, and those without
/// an ending or with a number for one, too. Throws Error if the folder cannot be read.
std::vector<FolderEntry> entriesOf(const std::filesystem::path& folder,
                                   const std::vector<std::string>& endings,
                                   const IsGridFolder& is_grid_folder);

class FileDialog {
 public:
  enum class Purpose {
    kOpenData,
    kLoadFunction,
    kSaveFunction,
    kSavePicture,
    kSaveMovie,
    kOpenSurface,
    kOpenFilm,
    kSaveFilm
  };
  struct Chosen {
    Purpose purpose;
    std::vector<std::filesystem::path> files;
    std::optional<ImageSize> size = std::nullopt;  // of a picture or a movie
    double frames_per_s = 0;                       // of a movie
    uint64_t frames = 0;                           // of a movie, if they were chosen; else 0
  };
  /// Size and rate of a movie, which can be changed.
  struct MovieOffer {
    ImageSize shown{0, 0}, size{0, 0};  // as the window shows it, and to begin with
    double text_pixels = 0;             // the height of the texts of the first
    double frames_per_s = 25;
    std::function<uint64_t(double frames_per_s)> frames = {};  // how many pictures it has at that rate
    bool has_encoder = true;                                   // ffmpeg, which .mp4 and .gif need
    uint64_t chosen_frames = 0;                                // in place of those; 0: they cannot be chosen
  };

  /// `is_grid_folder` may be empty: no folder is. `grid_endings`: of grids' files. `data_folder`: where data were opened last;
  /// may be empty.
  FileDialog(IsGridFolder is_grid_folder, std::vector<std::string> grid_endings,
             std::filesystem::path data_folder)
      : is_grid_folder_(std::move(is_grid_folder)),
        data_endings_(std::move(grid_endings)),
        data_folder_(std::move(data_folder)) {
    data_endings_.emplace_back(".splats");
  }

  /// Opens it with the next draw(), in the folder that was used last for data, or for all other files. `name`: the one that is offered.
  void open(Purpose purpose, const std::string& name = "");
  /// The same, to save a picture; `size` is offered, and can be changed. `text_pixels`: the height of its texts then.
  void openToSavePicture(const std::string& name, ImageSize size, double text_pixels);
  /// The same, to save a movie.
  void openToSaveMovie(const std::string& name, MovieOffer offer);
  /// Opens it again with files that it gave last and that cannot be used, and says why. No effect for others.
  void openAgain(const std::vector<std::filesystem::path>& files, const std::string& why);
  bool isOpen() const { return purpose_.has_value(); }
  /// Shows the list of the dialog's keys instead of the files, or the files again.
  void toggleHelp() { help_ = !help_; }
  const std::filesystem::path& dataFolder() const { return data_folder_; }
  /// Draws it, if it is open. Returns what was chosen, once.
  std::optional<Chosen> draw(Window& window);

 private:
  void enter(const std::filesystem::path& folder);
  std::string textsOf(ImageSize size) const;
  float heightBelow() const;
  void drawHelp(bool saves) const;
  void drawEntries(bool& accepts);
  std::vector<std::string> filesBetween(const std::string& first, const std::string& last) const;
  void select(std::vector<std::string> names);
  bool isTaken(const std::string& name) const;
  std::optional<Chosen> accept();
  void drawSize();
  void drawRate();

  const IsGridFolder is_grid_folder_;
  std::vector<std::string> data_endings_;  // of kOpenData
  std::optional<Purpose> purpose_;
  bool opens_ = false;
  int frames_to_focus_ = 0;  // at most: what is typed waits until the name has the focus
  bool all_files_ = false, help_ = false;
  std::filesystem::path data_folder_;  // from which data were opened last
  std::filesystem::path work_folder_;  // of pictures, films and states that were saved or opened last
  std::filesystem::path folder_;
  std::optional<Chosen> given_;  // last
  std::vector<FolderEntry> entries_;
  std::vector<std::string> taken_;  // names that were clicked
  std::string taken_text_;          // them, as they were put into `name_`
  std::string name_, error_, overwrites_;
  ImageSize size_{0, 0}, offered_size_{0, 0};  // of a picture or a movie
  double text_pixels_ = 0;                     // of one of the offered size
  MovieOffer movie_;
};

}  // namespace curvisplat
