#include "tools/window/file_dialog.h"

#include <fmt/format.h>
#include <imgui.h>
#include <imgui_stdlib.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <iterator>
#include <sstream>
#include <system_error>

#include "stream/base/error.h"
#include "stream/base/text.h"
#include "tools/window/keyboard_focus.h"
#include "tools/window/widgets.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxSide = 16384;     // of a picture, in pixels
constexpr int kFramesToFocus = 10;  // Dear ImGui takes two

struct Look {
  const char *title, *button;
  bool saves = false;
  std::vector<std::string> endings = {};
};

Look lookOf(FileDialog::Purpose purpose) {
  switch (purpose) {
    case FileDialog::Purpose::kOpenData:
      return {"Open a cache or a grid", "Open"};  // of FileDialog::data_endings_
    case FileDialog::Purpose::kLoadFunction:
      return {"Load colours and opacities", "Load", false, {".json"}};
    case FileDialog::Purpose::kSaveFunction:
      return {"Save colours and opacities", "Save", true, {".json"}};
    case FileDialog::Purpose::kSavePicture:
      return {"Save picture", "Save", true, {".png", ".exr", ".pfm"}};
    case FileDialog::Purpose::kOpenSurface:
      return {"Add a surface", "Add", false, {".stl", ".ply", ".obj"}};
    case FileDialog::Purpose::kOpenFilm:
      return {"Open a film", "Open", false, {".json"}};
    case FileDialog::Purpose::kSaveFilm:
      return {"Save film", "Save", true, {".json"}};
    case FileDialog::Purpose::kSaveMovie:
      return {"Save film", "Save", true, {".mp4", ".gif", ".html", ".png"}};
  }
  return {"", ""};
}

/// Whether a file can be of these endings: names without an ending and numbers, as those of steps and processors, can be
/// any. Letters may be large or small.
bool fits(fs::path name, const std::vector<std::string>& endings) {
  // Texts of programs and repositories are no data.
  for (const char* text : {"LICENSE", "LICENCE", "COPYING", "README", "AUTHORS", "NOTICE", "INSTALL", "NEWS",
                           "CHANGELOG", "TODO", "Makefile", "Dockerfile", "Allrun", "Allclean"})
    if (name == text) return false;
  for (const char* compressed : {".gz", ".xz", ".zst"})
    if (name.extension() == compressed) name = name.stem();
  std::string ending = name.extension().string();
  std::ranges::transform(ending, ending.begin(), [](unsigned char c) { return std::tolower(c); });
  const bool is_number = std::ranges::all_of(ending.substr(std::min<size_t>(1, ending.size())),
                                             [](unsigned char c) { return std::isdigit(c) != 0; });
  return is_number || std::ranges::find(endings, ending) != endings.end();
}

/// Whether a folder is opened as a whole.
bool isOneFile(const fs::path& folder, const IsGridFolder& is_grid_folder) {
  return folder.extension() == ".splats" || (is_grid_folder && is_grid_folder(folder));
}

std::string sizeText(uint64_t bytes) {
  const auto number = static_cast<double>(bytes);
  if (number < 1e3) return fmt::format("{} B", bytes);
  if (number < 1e6) return fmt::format("{:.0f} kB", number / 1e3);
  return number < 1e9 ? fmt::format("{:.1f} MB", number / 1e6) : fmt::format("{:.2f} GB", number / 1e9);
}

}  // namespace

std::vector<FolderEntry> entriesOf(const fs::path& folder, const std::vector<std::string>& endings,
                                   const IsGridFolder& is_grid_folder) {
  std::vector<FolderEntry> entries;
  std::error_code error;
  const bool is_for_data = std::ranges::find(endings, ".splats") != endings.end();
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    const std::string name = at->path().filename().string();
    if (name.starts_with('.')) continue;
    std::error_code ignored;
    const bool is_directory = at->is_directory(ignored);
    const bool is_folder = is_directory && !isOneFile(at->path(), is_grid_folder);
    const bool has_ending = std::ranges::find(endings, at->path().extension().string()) != endings.end();
    const bool is_listed = is_folder || endings.empty() ||
                           (is_for_data ? is_directory || fits(name, endings) : !is_directory && has_ending);
    if (!is_listed) continue;
    const uint64_t bytes = is_directory ? 0 : at->file_size(ignored);
    entries.push_back({name, is_folder, ignored ? 0 : bytes});
  }
  if (error) throw Error("{}: cannot be read: {}", folder.string(), error.message());
  std::sort(entries.begin(), entries.end(), [](const FolderEntry& a, const FolderEntry& b) {
    return a.is_folder != b.is_folder ? a.is_folder : a.name < b.name;
  });
  return entries;
}

void FileDialog::open(Purpose purpose, const std::string& name) {
  purpose_ = purpose;
  opens_ = true;
  frames_to_focus_ = kFramesToFocus;
  all_files_ = help_ = false;
  std::error_code ignored;
  const fs::path& last = purpose == Purpose::kOpenData ? data_folder_ : work_folder_;
  enter(fs::is_directory(last, ignored) ? last : fs::current_path(ignored));
  select({});
  name_ = name;
}

void FileDialog::openToSavePicture(const std::string& name, ImageSize size, double text_pixels) {
  text_pixels_ = text_pixels;
  open(Purpose::kSavePicture, name);
  size_ = offered_size_ = size;
}

void FileDialog::openToSaveMovie(const std::string& name, MovieOffer offer) {
  text_pixels_ = offer.text_pixels;
  open(Purpose::kSaveMovie, name);
  size_ = offer.size;
  offered_size_ = offer.shown;
  movie_ = std::move(offer);
}

void FileDialog::openAgain(const std::vector<fs::path>& files, const std::string& why) {
  if (isOpen() || !given_ || given_->files != files) return;
  open(given_->purpose);  // in the folder of the first
  std::vector<std::string> names;
  for (const fs::path& file : files)
    names.push_back((file.parent_path() == folder_ ? file.filename() : file).string());
  select(std::move(names));
  error_ = why;
}

void FileDialog::enter(const fs::path& folder) {
  error_.clear();
  overwrites_.clear();
  const Look look = lookOf(*purpose_);
  if (!look.saves) select({});
  try {
    const auto& endings = *purpose_ == Purpose::kOpenData ? data_endings_ : look.endings;
    entries_ = entriesOf(folder, all_files_ ? std::vector<std::string>{} : endings, is_grid_folder_);
    folder_ = folder;
  } catch (const Error& error) {
    error_ = error.what();
  }
}

std::optional<FileDialog::Chosen> FileDialog::draw(Window& window) {
  if (!purpose_) return std::nullopt;
  const Look look = lookOf(*purpose_);
  if (std::exchange(opens_, false)) ImGui::OpenPopup(look.title);
  const ImVec2 whole = ImGui::GetIO().DisplaySize;
  const float unit = ImGui::GetFontSize();
  ImGui::SetNextWindowSize({std::min(46 * unit, whole.x), std::min(32 * unit, whole.y)}, ImGuiCond_Appearing);
  ImGui::SetNextWindowPos({0.5f * whole.x, 0.5f * whole.y}, ImGuiCond_Appearing, {0.5f, 0.5f});
  ImGui::PushStyleVar(ImGuiStyleVar_WindowBorderSize, 1);  // it is as dark as what lies behind it
  const bool is_open = ImGui::BeginPopupModal(look.title);
  ImGui::PopStyleVar();
  if (!is_open) {
    purpose_.reset();
    return std::nullopt;
  }
  window.cover({0, 0, static_cast<double>(whole.x), static_cast<double>(whole.y)});
  bool accepts = false;
  if (ImGui::Button("Up")) enter(folder_.parent_path());
  nameWidget("file up");
  ImGui::SameLine();
  const char* const home = std::getenv("HOME");
  if (home) {
    if (ImGui::Button("Home")) enter(home);
    nameWidget("file home");
    ImGui::SameLine();
  }
  ImGui::TextUnformatted(folder_.c_str());
  help_ ? drawHelp(look.saves) : drawEntries(accepts);
  if (!error_.empty()) {
    ImGui::TextWrapped("%s", error_.c_str());
    nameWithoutTab("file error " + error_);
  }
  ImGui::SetNextItemWidth(-1);
  if (ImGui::IsWindowAppearing()) ImGui::SetKeyboardFocusHere();
  // Where no widget has the keyboard, Return is the button's.
  accepts |= ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_Enter), false) && !ImGui::IsAnyItemActive() &&
             !keyboardFocus().isShown();
  accepts |= ImGui::InputTextWithHint("##name", look.saves ? "name" : "name, or a path", &name_,
                                      ImGuiInputTextFlags_EnterReturnsTrue);
  nameWidget("file name");
  // Dear ImGui gives a field no letters in the frame in which it gets the focus.
  frames_to_focus_ = ImGui::IsItemActive() ? 0 : std::max(0, frames_to_focus_ - 1);
  if (frames_to_focus_ > 0) window.holdInput();
  if (*purpose_ == Purpose::kSavePicture || *purpose_ == Purpose::kSaveMovie) drawSize();
  if (*purpose_ == Purpose::kSaveMovie) drawRate();
  accepts |= ImGui::Button(look.button);
  nameWidget("file accept");
  ImGui::SameLine();
  bool cancels = ImGui::Button("Cancel");
  nameWidget("file cancel");
  if (ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_Escape))) cancels |= !std::exchange(help_, false);
  ImGui::SameLine();
  if (*purpose_ == Purpose::kOpenData) {
    const bool toggles = ImGui::Checkbox("all files", &all_files_);
    nameWidget("all files");
    if (toggles) enter(fs::path(folder_));
    ImGui::SameLine();
  }
  if (*purpose_ == Purpose::kOpenData)
    ImGui::TextDisabled("Ctrl or Shift + click takes several: a grid and its solutions");
  else if (*purpose_ == Purpose::kSaveMovie)
    ImGui::TextDisabled("%s",
                        movie_.has_encoder
                            ? ".mp4 or .gif; .html: a page that plays it; .png: numbered pictures"
                            : ".html: a page that plays it; .png: numbered pictures; .mp4, .gif need ffmpeg");
  else if (*purpose_ == Purpose::kSavePicture)
    ImGui::TextDisabled("%s", textsOf(size_).c_str());
  std::optional<Chosen> chosen;
  if (accepts) chosen = accept();
  if (chosen) {
    std::error_code ignored;
    const fs::path from = chosen->files.front().parent_path();
    if (fs::is_directory(from, ignored))  // also of a typed path
      (chosen->purpose == Purpose::kOpenData ? data_folder_ : work_folder_) = from;
    given_ = chosen;
  }
  if (cancels || chosen) {
    ImGui::CloseCurrentPopup();
    purpose_.reset();
  }
  ImGui::EndPopup();
  return chosen;
}

/// Describes the texts of a picture: they take the same part of its height, whatever its size.
std::string FileDialog::textsOf(ImageSize size) const {
  return fmt::format("texts {:.0f} pixels high", text_pixels_ * size.height / offered_size_.height);
}

float FileDialog::heightBelow() const {
  const float lines = *purpose_ == Purpose::kSavePicture ? 3.6f
                      : *purpose_ == Purpose::kSaveMovie ? 4.6f
                                                         : 2.6f;
  const float wide = ImGui::GetContentRegionAvail().x;
  const float of_error = error_.empty() ? 0
                                        : ImGui::CalcTextSize(error_.c_str(), nullptr, false, wide).y +
                                              ImGui::GetStyle().ItemSpacing.y;
  return lines * ImGui::GetFrameHeightWithSpacing() + of_error;
}

/// Draws the list of the dialog's keys where the files are otherwise.
void FileDialog::drawHelp(bool saves) const {
  ImGui::BeginChild("entries", {0, -heightBelow()}, true);
  nameArea("dialog keys", 0, 0, 1, 1);
  std::vector<KeyRow> rows{
      {"Return", saves ? "saves under the name" : "opens what is named or chosen; enters a folder"},
      {"Esc", "shows the files again; there, closes the dialog"},
      {"click", "chooses a file"},
      {"double click", saves ? "saves under its name; enters a folder" : "opens a file; enters a folder"}};
  if (*purpose_ == Purpose::kOpenData) {
    rows.push_back({"Ctrl + click", "chooses several: a grid and its solutions"});
    rows.push_back({"Shift + click", "chooses all from the chosen one to this one"});
  }
  rows.push_back({"F1", "shows the files again"});
  drawKeyTable(rows);
  ImGui::EndChild();
}

/// Width and height in pixels, and buttons for usual ones.
void FileDialog::drawSize() {
  const auto number = [](const char* name, int& value) {
    ImGui::SetNextItemWidth(5 * ImGui::GetFontSize());
    ImGui::InputInt(fmt::format("##{}", name).c_str(), &value, 0, 0);
    nameWidget(name);
    value = std::clamp(value, 1, kMaxSide);
    ImGui::SameLine();
  };
  ImGui::AlignTextToFramePadding();
  ImGui::TextUnformatted("size");
  ImGui::SameLine();
  number("picture width", size_.width);
  ImGui::TextUnformatted("x");
  ImGui::SameLine();
  number("picture height", size_.height);
  ImGui::TextUnformatted("pixels");
  nameWidget(fmt::format("picture of {} x {}", size_.width, size_.height));
  nameWidget(textsOf(size_));
  const auto offer = [this](const char* text, ImageSize size) {
    ImGui::SameLine();
    if (ImGui::Button(text)) size_ = size;
    nameWidget(fmt::format("picture size {}", text));
  };
  offer("As shown", offered_size_);
  offer("Twice that",
        {std::min(kMaxSide, 2 * offered_size_.width), std::min(kMaxSide, 2 * offered_size_.height)});
  offer("1920 x 1080", {1920, 1080});
  offer("3840 x 2160", {3840, 2160});
}

/// Pictures a second, and how long that takes.
void FileDialog::drawRate() {
  constexpr double kMax = 120;
  ImGui::AlignTextToFramePadding();
  ImGui::TextUnformatted("rate");
  ImGui::SameLine();
  ImGui::SetNextItemWidth(5 * ImGui::GetFontSize());
  ImGui::InputDouble("##rate", &movie_.frames_per_s, 0, 0, "%.4g");
  nameWidget("movie rate");
  movie_.frames_per_s = std::clamp(movie_.frames_per_s, 1.0, kMax);
  ImGui::SameLine();
  ImGui::TextUnformatted("pictures a second,");
  ImGui::SameLine();
  if (movie_.chosen_frames > 0) {
    constexpr int kMaxFrames = 10'000;
    int chosen = static_cast<int>(movie_.chosen_frames);
    ImGui::SetNextItemWidth(5 * ImGui::GetFontSize());
    ImGui::InputInt("##frames", &chosen, 0, 0);
    nameWidget("movie pictures");
    movie_.chosen_frames = static_cast<uint64_t>(std::clamp(chosen, 1, kMaxFrames));
    ImGui::SameLine();
  }
  const uint64_t frames =
      movie_.chosen_frames > 0 ? movie_.chosen_frames : movie_.frames(movie_.frames_per_s);
  const double seconds = static_cast<double>(frames) / movie_.frames_per_s;
  const std::string pictures = countText(frames, "picture");
  ImGui::TextUnformatted(movie_.chosen_frames > 0 ? fmt::format("pictures in all: {:.1f} s", seconds).c_str()
                                                  : fmt::format("{}: {:.1f} s", pictures, seconds).c_str());
  nameWidget(fmt::format("movie of pictures a second: {}, {:.1f} s", pictures, seconds));
  ImGui::SameLine();
  ImGui::TextDisabled("%s", textsOf(size_).c_str());
}

/// A click takes a name, with Control several; a double click opens.
void FileDialog::drawEntries(bool& accepts) {
  ImGui::BeginChild("entries", {0, -heightBelow()}, true);
  std::optional<fs::path> entered;
  if (entries_.empty())
    ImGui::TextDisabled("%s", lookOf(*purpose_).saves
                                  ? "There is no such file in this folder yet."
                                  : "No file in this folder is of a kind that can be chosen here.");
  for (const FolderEntry& entry : entries_) {
    const std::string shown = entry.is_folder ? entry.name + "/" : entry.name;
    const bool chosen =
        ImGui::Selectable(shown.c_str(), isTaken(entry.name),
                          ImGuiSelectableFlags_AllowDoubleClick | ImGuiSelectableFlags_DontClosePopups);
    nameWidget("file " + entry.name);
    if (!entry.is_folder && entry.bytes > 0) {
      const std::string size = sizeText(entry.bytes);
      ImGui::SameLine(ImGui::GetContentRegionMax().x - ImGui::CalcTextSize(size.c_str()).x);
      if (isTaken(entry.name))
        ImGui::TextUnformatted(size.c_str());
      else
        ImGui::TextDisabled("%s", size.c_str());
    }
    if (!chosen) continue;
    const bool twice = ImGui::IsMouseDoubleClicked(ImGuiMouseButton_Left);
    if (entry.is_folder) {
      // Named, it is entered by "open", too.
      if (!lookOf(*purpose_).saves) select({entry.name});
      if (twice) entered = folder_ / entry.name;
      continue;
    }
    std::vector<std::string> names{entry.name};
    if (ImGui::GetIO().KeyShift && *purpose_ == Purpose::kOpenData && !twice && !taken_.empty()) {
      names = filesBetween(taken_.front(), entry.name);
    } else if (ImGui::GetIO().KeyCtrl && *purpose_ == Purpose::kOpenData && !twice) {
      names = taken_;
      if (std::erase(names, entry.name) == 0) names.push_back(entry.name);
    }
    select(std::move(names));
    accepts |= twice;
  }
  ImGui::EndChild();
  if (entered) enter(*entered);
}

/// The files of the list from `first` to `last`, whichever comes first there; `first` begins what is returned.
std::vector<std::string> FileDialog::filesBetween(const std::string& first, const std::string& last) const {
  const auto at = [&](const std::string& name) {
    return std::ranges::find(entries_, name, &FolderEntry::name) - entries_.begin();
  };
  const auto from = at(first), to = at(last), count = static_cast<ptrdiff_t>(entries_.size());
  std::vector<std::string> names;
  if (from < count)
    for (auto n = from; n != to + (to < from ? -1 : 1); n += to < from ? -1 : 1)
      if (const FolderEntry& entry = entries_[static_cast<size_t>(n)]; !entry.is_folder)
        names.push_back(entry.name);
  return names.empty() ? std::vector{last} : names;
}

void FileDialog::select(std::vector<std::string> names) {
  taken_ = std::move(names);
  name_.clear();
  for (const std::string& name : taken_) name_ += (name_.empty() ? "" : " ") + name;
  taken_text_ = name_;
}

/// Whether a name was taken by a click, as long as nothing was typed since, or because it was typed.
bool FileDialog::isTaken(const std::string& name) const {
  if (name_ != taken_text_) return name_ == name;
  return std::find(taken_.begin(), taken_.end(), name) != taken_.end();
}

std::optional<FileDialog::Chosen> FileDialog::accept() {
  const Look look = lookOf(*purpose_);
  std::error_code ignored;
  const auto whole = [&](const std::string& name) {
    return fs::path(name).is_absolute() ? fs::path(name) : folder_ / name;
  };
  if (name_.empty()) {
    error_ = look.saves ? "type a name first" : "choose a file first, or type its name";
    return std::nullopt;
  }
  if (const fs::path path = whole(name_);
      fs::is_directory(path, ignored) && !isOneFile(path, is_grid_folder_)) {
    enter(path);
    name_.clear();
    return std::nullopt;
  }
  Chosen chosen{*purpose_, {}};
  if (look.saves) {
    fs::path path = whole(name_);
    const bool lacks_encoder = *purpose_ == Purpose::kSaveMovie && !movie_.has_encoder;
    if (path.extension().empty()) path += lacks_encoder ? ".html" : look.endings.front();
    // The second time it is meant.
    if (fs::exists(path, ignored) && overwrites_ != path.string()) {
      overwrites_ = path.string();
      error_ = path.filename().string() + " exists; save again to replace it";
      return std::nullopt;
    }
    chosen.files.push_back(path);
    if (*purpose_ == Purpose::kSavePicture || *purpose_ == Purpose::kSaveMovie) chosen.size = size_;
    if (*purpose_ == Purpose::kSaveMovie) {
      chosen.frames_per_s = movie_.frames_per_s;
      chosen.frames = movie_.chosen_frames;
    }
    return chosen;
  }
  if (fs::exists(whole(name_), ignored)) {
    chosen.files.push_back(whole(name_));  // perhaps with spaces in its name
    return chosen;
  }
  std::vector<std::string> names = taken_;  // perhaps with spaces
  if (name_ != taken_text_) {
    std::istringstream words(name_);
    names.assign(std::istream_iterator<std::string>(words), {});
  }
  for (const std::string& name : names) {
    if (!fs::exists(whole(name), ignored)) {
      error_ = name + " does not exist";
      return std::nullopt;
    }
    chosen.files.push_back(whole(name));
  }
  return chosen;
}

}  // namespace curvisplat
