// The picture of a cache in the window, and what is saved of it.
#include <fmt/format.h>
#include <imgui.h>

#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <future>
#include <glm/geometric.hpp>
#include <utility>

#include <GLFW/glfw3.h>

#include "render/image/image_file.h"
#include "render/mesh/triangle_mesh.h"
#include "stream/base/durable_file.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/threads.h"
#include "stream/codec/values_codec.h"
#include "tools/panels/picture_signs.h"
#include "tools/view/first_view.h"
#include "tools/view/picture_layout.h"
#include "tools/view/saved_views.h"
#include "tools/viewer/cache_view.h"
#include "tools/viewer/navigation.h"
#include "tools/window/widgets.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxNamedFiles = 4;  // in a command; of a longer series its kept cache
constexpr const char* kNoData = "no data here";
constexpr double kPointedForSeconds = 0.3;  // the mouse rests that long before values are looked for

ImVec2 toImGui(double x, double y) {
  return {static_cast<float>(x), static_cast<float>(y)};
}

}  // namespace

void CacheView::showPicture(const WindowLayout& layout) {
  ImDrawList* const list = ImGui::GetBackgroundDrawList();
  const Rectangle& place = layout.picture;
  const double right = place.x + place.width, bottom = place.y + place.height;
  nameArea("picture", place.x, place.y, place.width, place.height);
  nameArea(fmt::format("read back {}", read_bytes_), place.x, place.y, place.width, place.height);
  const glm::vec4 paper = state_.background();
  list->AddRectFilled(toImGui(place.x, place.y), toImGui(right, bottom),
                      ImGui::ColorConvertFloat4ToU32({paper.x, paper.y, paper.z, 1}));
  if (!picture_.isEmpty()) {
    const double cut = 0.5 * (1 - shown_width_);
    list->AddImage(picture_.id(), toImGui(place.x, place.y),
                   toImGui(right - shown_strip_ * place.width, bottom), toImGui(cut, 0), toImGui(1 - cut, 1));
  }
  if (!overlay_.isEmpty()) list->AddImage(overlay_.id(), toImGui(place.x, place.y), toImGui(right, bottom));
}

/// Finds a point in the picture that is shown.
std::optional<glm::dvec2> CacheView::placeOf(const glm::dvec3& point, const WindowLayout& layout) const {
  if (!shown_) return std::nullopt;
  const ScreenView& view = shown_->view;
  const glm::dvec3 seen = view.viewFromData(point);
  if (view.projection == Projection::kPerspective && seen.z < view.near) return std::nullopt;
  const glm::dvec2 pixel = view.pixelFromView(seen);
  const double width = (1 - shown_strip_) * layout.picture.width;
  return glm::dvec2(layout.picture.x + pixel.x / view.size.width * width,
                    layout.picture.y + pixel.y / view.size.height * layout.picture.height);
}

void CacheView::showPlanesAndMarkers(const WindowLayout& layout) {
  const auto place = [&](const glm::dvec3& point) { return placeOf(point, layout); };
  // Draws only within the picture, not over the scalar bars.
  const Rectangle& whole = layout.picture;
  ImDrawList* const list = ImGui::GetBackgroundDrawList();
  list->PushClipRect(toImGui(whole.x, whole.y),
                     toImGui(whole.x + (1 - shown_strip_) * whole.width, whole.y + whole.height));
  drawMarkerSigns(state_, place);
  // Over the signs: they are what one takes hold of.
  if (shows_frames_) changed_ |= handles_.draw(state_, manifest(), place, window_);
  if (state_.annotations.axes && axis_names_) lookAlongPressedAxis(layout);
  list->PopClipRect();
}

/// Looks from the end of an axis whose name in the picture is pressed; from its other end where it is seen so already.
void CacheView::lookAlongPressedAxis(const WindowLayout& layout) {
  constexpr std::pair<Command, Command> kLooks[]{{Command::kLookPlusX, Command::kLookMinusX},
                                                 {Command::kLookPlusY, Command::kLookMinusY},
                                                 {Command::kLookPlusZ, Command::kLookMinusZ}};
  std::array<glm::dvec2, 3> places = *axis_names_;
  for (glm::dvec2& place : places)
    place = glm::dvec2(layout.picture.x, layout.picture.y) + place / window_.pixelScale();
  const std::optional<size_t> pressed = pressedAxis(places, window_);
  if (!pressed) return;
  const glm::dvec3 forward = glm::normalize(state_.camera.focal_point - state_.camera.position);
  const bool is_seen = forward[static_cast<int>(*pressed)] < -0.999;
  run(is_seen ? kLooks[*pressed].second : kLooks[*pressed].first);
}

/// Finds the values where the mouse rests: first the depth of the picture's pixels, then what the data have
/// at that point. A click makes a marker of it.
void CacheView::probe(const WindowLayout& layout) {
  const double width = (1 - shown_strip_) * layout.picture.width;
  const auto pixelAt = [&](const glm::dvec2& at) {
    return glm::dvec2((at.x - layout.picture.x) / width * data_size_.width,
                      (at.y - layout.picture.y) / layout.picture.height * data_size_.height);
  };
  for (const glm::dvec2& click : window_.takeClicks()) {
    clicked_ = {pixelAt(click), shown_ ? shown_->camera : state_.camera, data_size_, playback_.position()};
    if (!std::exchange(values_failed_, false)) continue;
    values_asked_for_ = 0;  // tries again
    changed_ |= frames_failed_ || !isShown();
  }
  const auto pointed = window_.pointed();
  if (!pointed || *pointed != pointed_) {
    pointed_since_s_ = glfwGetTime();
    pointed_ = pointed.value_or(glm::dvec2(-1.0));
    if (!pointed) probed_.clear();
  }
  if (clicked_ && !isSeenAt(*clicked_)) {
    clicked_.reset();  // another point lies under that pixel now
    say("No marker was set, because the view has changed since the click.", About::kMarker);
  }
  const bool rests = pointed && glfwGetTime() - pointed_since_s_ > kPointedForSeconds;
  if ((rests || clicked_) && isFinal() && !frames_failed_ && !frames_->busy() &&
      values_asked_for_ != request_) {
    values_asked_for_ = request_;
    frames_->requestValues();
  }
  if (values_ && values_->request == request_) {
    const auto question = [&](const glm::dvec2& pixel) -> std::optional<PointProbe::Question> {
      const auto point = pointSeenAt(*values_, manifest(), pixel, data_size_);
      if (!point) return std::nullopt;
      return PointProbe::Question{*point, cache_.variableNamed(state_.variable), playback_.position()};
    };
    if (clicked_) {
      marker_question_ = question(std::exchange(clicked_, std::nullopt)->pixel);
      if (marker_question_)
        probe_.ask(*marker_question_, true);
      else
        say("There is nothing at this place.", About::kMarker);
    } else if (pointed && !marker_question_) {
      if (const auto asked = question(pixelAt(*pointed)))
        probe_.ask(*asked);
      else
        probed_ = kNoData;
    }
  }
  std::optional<PointProbe::Answer> answer;
  try {
    answer = probe_.poll();
  } catch (const Error& error) {
    probed_ = fmt::format("the value here cannot be read: {}", error.what());
    if (std::exchange(marker_question_, std::nullopt)) reports_.report(error);
  }
  if (!answer) return;
  const VariableInfo& variable = manifest().variables[answer->question.variable];
  const bool for_marker = marker_question_ && *marker_question_ == answer->question;
  if (for_marker) marker_question_.reset();
  if (!answer->found) {
    probed_ = kNoData;
    return;
  }
  const Marker marker = markerOf(state_, variable, answer->question.point, *answer->found);
  probed_ = textOf(marker, manifest());
  // Its nodes are not those of the grid.
  if (preview_) probed_ = probed_.substr(0, probed_.find(';')) + ", of the preview";
  if (!for_marker) return;
  state_.markers.push_back(marker);
  rests_ = false;
  say(fmt::format("marker {}: {}", marker.name, probed_), About::kMarker);
}

/// Whether what is shown now is seen under the same pixel as when it was clicked.
bool CacheView::isSeenAt(const Click& click) const {
  return isSameView(click.camera, state_.camera) && click.size.width == data_size_.width &&
         click.size.height == data_size_.height && click.at == playback_.position();
}

void CacheView::drawStatus(const WindowLayout& layout) {
  const Rectangle& place = layout.status;
  ImGui::SetNextWindowPos(toImGui(place.x, place.y));
  ImGui::SetNextWindowSize(toImGui(place.width, place.height));
  ImGui::PushStyleVar(ImGuiStyleVar_WindowMinSize, ImVec2(1, 1));
  ImGui::PushStyleVar(ImGuiStyleVar_WindowRounding, 0);
  ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding,
                      ImVec2(ImGui::GetStyle().FramePadding.x * 2, ImGui::GetStyle().FramePadding.y));
  ImGui::Begin("status", nullptr,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoSavedSettings |
                   ImGuiWindowFlags_NoBringToFrontOnFocus | ImGuiWindowFlags_NoNav);
  const bool looks =
      values_asked_for_ == request_ && !values_failed_ && !(values_ && values_->request == request_);
  const bool points = window_.pointed().has_value();
  const bool sets_marker = clicked_ || marker_question_;
  const std::string text = sets_marker && isFinal() ? "reading the value of the marker ..."
                           : sets_marker            ? "a marker follows when the picture is final"
                           : !probed_.empty()       ? probed_
                           : looks && points        ? "reading the value under the mouse ..."
                           : points && !isFinal()   ? "values when the picture is final"
                                                    : "";
  ImGui::TextUnformatted(text.c_str());
  nameArea("status " + text, place.x, place.y, place.width, place.height);
  const std::string state =
      (preview_ ? fmt::format("preview of {}, ", preview_->what) : "") +
      (chooser_.busy() ? "choosing colours, " : "") +
      stateOfPicture({shown_ ? &shown_->statistics : nullptr, isFinal(), isRefining(), ""}) + lacks();
  ImGui::SameLine(static_cast<float>(place.width) - ImGui::CalcTextSize(state.c_str()).x -
                  2 * ImGui::GetStyle().FramePadding.x);
  ImGui::TextDisabled("%s", state.c_str());
  nameWidget("state " + state);
  ImGui::End();
  ImGui::PopStyleVar(3);
}

void CacheView::saveTo(const fs::path& file) {
  save_to_ = file;
  changed_ |= frames_failed_;  // tries again
}

/// A picture that stays on the card is drawn again to be read: the same one.
void CacheView::savePictureIfFinal() {
  if (!save_to_ || !isFinal() || !finding_isosurfaces_.empty()) return;
  if (shown_->on_card) {
    reports_.attempt([&] { ask(false, true); }, About::kPicture);
    return;
  }
  fs::path file = *std::exchange(save_to_, std::nullopt);
  const bool numbered = file.empty();
  for (int number = 1; file.empty() || (numbered && fs::exists(file)); ++number)
    file = fmt::format("{}_{:04}.png", name(), number);
  try {
    const ShownFunctions functions(state_, manifest());
    const AnnotatedScene scene =
        sceneOf(state_, functions, *shown_, picture_size_, globe_grid_.boxOf(state_, cache_));
    writeImage(annotated(shown_->image, savedAnnotations(state_), scene), file);
    reports_.settle(About::kSaving);
    say("saved " + fs::absolute(file).string() +
            (preview_ ? fmt::format(", of the preview ({})", preview_->what) : "") + lacks(),
        About::kSaving);
  } catch (const Error& error) {
    reports_.report(error, About::kSaving);
  }
}

/// The option that draws the time that is shown, or the times of the film; empty of one step.
std::string CacheView::timeOption(bool of_film) const {
  const StepPosition at = playback_.position();
  if (playback_.steps() == 1) return {};
  if (of_film) return playback_.interpolates() ? " --interpolate" : "";
  return at.part == 0 ? fmt::format(" --step {}", at.step)
                      : fmt::format(" --time={} --interpolate", cache_.series().timeAt(at));
}

void CacheView::copyCommand(MovieKind what) {
  try {
    const bool of_film = what == MovieKind::kFilm;
    if (of_film && !film_.film()) return;  // its key frames were removed meanwhile
    CommandOptions options{shortPath(preview_ ? preview_->whole : cache_.wholePath()), picture_size_, {}, {}};
    options.program = programWord();
    ViewState state = state_;
    if (what != MovieKind::kOnePicture) {
      const MovieRequest movie = copiedMovie(what);
      state = movie.state;
      options.size = movie.size;
      options.frames_per_s = movie.frames_per_s;
      (of_film ? options.film_frames : options.turn_frames) = framesOf(movie);
    }
    if (!grid_files_.empty() && grid_files_.size() <= kMaxNamedFiles) {
      options.cache = shortPath(grid_files_.front());
      for (size_t n = 1; n < grid_files_.size(); ++n) options.solutions.push_back(shortPath(grid_files_[n]));
      options.precision = precisionOf(cache_.seriesManifest());
    }
    const auto keep = [&](const EditedFunction& function, const char* what, fs::path& file) {
      if (!needsFile(function)) return;
      // Beside the picture that the command will write.
      file = fmt::format("{}_{}.json", name(), what);
      writeFileDurably(file, toParaViewPreset(function.definition()));
    };
    if (of_film) {
      // Another name than that of a film that is saved, which may have been changed since.
      options.film = fmt::format("{}_shown_film.json", name());
      writeFileDurably(options.film, film_.film()->toJson());
    } else {
      keep(state_.function, "colours", options.function_file);
    }
    if (state_.opacity_by) keep(state_.opacity_by->function, "opacities", options.opacity_file);
    const std::string command =
        renderCommand(state, options) + timeOption(of_film) + (lacks().empty() ? "" : " --keep-going");
    window_.setClipboard(command);
    fmt::print("{}\n", command);
    std::fflush(stdout);
    const char* const shown = of_film                       ? "the film"
                              : what == MovieKind::kOneTurn ? "a film once around"
                                                            : "this picture";
    // Its paths are short ones.
    say(fmt::format("copied the command for {}; paste it into a terminal in {}", shown,
                    fs::current_path().string()));
  } catch (const Error& error) {
    reports_.report(error);
  }
}

void CacheView::use(const FileDialog::Chosen& chosen) {
  const fs::path& file = chosen.files.front();
  try {
    switch (chosen.purpose) {
      case FileDialog::Purpose::kLoadFunction:
        chooser_.drop();
        state_.function = EditedFunction(readParaViewPreset(file), state_.function.opacityUnit());
        ++function_version_;
        changed_ = true;
        return;
      case FileDialog::Purpose::kSaveFunction:
        writeFileDurably(file, toParaViewPreset(state_.function.definition()));
        return say(fmt::format("saved colours and opacities to {}", file.string()));
      case FileDialog::Purpose::kSavePicture:
        if (chosen.size && !same(*chosen.size, picture_size_)) return savePictureOf(file, *chosen.size);
        return saveTo(file);
      case FileDialog::Purpose::kOpenSurface:
        return readSurface(file);
      case FileDialog::Purpose::kSaveMovie:
        return saveMovieTo(chosen);
      case FileDialog::Purpose::kOpenFilm:
        return openFilm(file);
      case FileDialog::Purpose::kSaveFilm:
        if (!film_.film()) return;
        writeFileDurably(file, film_.film()->toJson());
        return say(fmt::format("saved the film to {}", file.string()));
      case FileDialog::Purpose::kOpenData:
        return;
    }
  } catch (const Error& error) {
    reports_.report(error);
    dialog_.openAgain(chosen.files, error.what());
  }
}

void CacheView::saveView(const std::string& name) {
  try {
    writeState(savedViewOf(whole(), name), toJson(state_));
    views_ = savedViewsOf(whole());
    say(fmt::format("saved the view \"{}\": View, Saved views", name));
  } catch (const Error& error) {
    reports_.report(error);
  }
}

void CacheView::loadView(const std::string& name) {
  try {
    const fs::path file = savedViewOf(whole(), name);
    ViewState state = viewStateFromJson(readTextFile(file), file, manifest());
    loadSurfaces(state);
    state.given = state_.given;
    restore(state);
    panels_.forgetObjects();  // the next view is chosen where this one was
  } catch (const Error& error) {
    reports_.report(error);
  }
}

std::vector<std::string> CacheView::otherScalars() const {
  std::vector<std::string> names{"the same scalar"};
  for (const VariableInfo& one : manifest().variables)
    if (one.name != state_.variable) names.push_back(one.name);
  return names;
}

void CacheView::addTo(MenuFacts& facts) {
  for (const VariableInfo& one : manifest().variables) facts.scalars.push_back(one.name);
  facts.scalars.insert(facts.scalars.end(), elsewhere_.begin(), elsewhere_.end());
  facts.scalar = state_.variable;
  facts.opacity_scalars = otherScalars();
  facts.opacity_scalar = state_.opacity_by ? state_.opacity_by->variable : facts.opacity_scalars.front();
  facts.views = views_;
  facts.faces = face_names_;
  facts.further = furtherScalars();
}

FurtherScalars CacheView::furtherScalars() {
  FurtherScalars further = further_.known();
  further.is_busy = adds_scalar_;
  if (preview_) further.note = "more when the whole is there";
  return further;
}

void CacheView::choose(const MenuChoice& choice) {
  if (choice.view) loadView(*choice.view);
  if (choice.faces) addFaces(*choice.faces);
  if (choice.looks_for_scalars) further_.look();
  if (choice.add_scalar) wanted_scalar_ = WantedScalar{*choice.add_scalar};
  if (choice.add_opacity_scalar) wanted_scalar_ = WantedScalar{*choice.add_opacity_scalar, true};
  if (choice.scalar) chooseScalar(*choice.scalar);
  if (choice.opacity_scalar)
    chooseOpacityScalar(*choice.opacity_scalar == otherScalars().front() ? "" : *choice.opacity_scalar);
}

void CacheView::chooseScalar(const std::string& name) {
  using For = FunctionChooser::For;
  if (hasElsewhere(name)) {
    wanted_scalar_ = WantedScalar{name};
    return;
  }
  const bool is_shown = name == state_.variable;
  if (!is_shown) return chooser_.ask({For::kScalar, name, state_.coloursSheets()});
  chooser_.drop(For::kScalar);  // one that was chosen before
}

void CacheView::showScalar(const std::string& name) {
  chooseVariable(state_, manifest(), name);
  if (state_.opacity_by && state_.opacity_by->variable == name) state_.opacity_by.reset();
  ++function_version_;
  changed_ = true;
}

void CacheView::chooseOpacityScalar(const std::string& name) {
  using For = FunctionChooser::For;
  const std::string& shown = state_.opacityScalar();
  const bool is_shown = (name.empty() ? state_.variable : name) == shown;
  if (!is_shown && !name.empty() && name != state_.variable) return chooser_.ask({For::kOpacities, name});
  chooser_.drop(For::kOpacities);  // one that was chosen before
  if (is_shown) return;
  state_.opacity_by.reset();
  ++function_version_;
  changed_ = true;
}

void CacheView::useScalar(const WantedScalar& wanted) {
  if (!manifest().variable(wanted.name))
    return say(
        fmt::format("{} has values at other samples: it is drawn by itself, as the scalar.", wanted.name));
  if (wanted.for_opacities) return chooseOpacityScalar(wanted.name);
  if (wanted.for_faces) return colourFaces(wanted.name);
  findIsosurface(wanted.name, wanted.isosurface);
}

void CacheView::addFaces(const std::string& name) {
  if (state_.surfaces.size() + state_.faces.size() >= kMaxSurfaces)
    return say(fmt::format("There are {} surfaces, and no more can be added.", kMaxSurfaces));
  state_.faces.push_back({name});
  changed_ = true;
}

/// An empty name: each has its own colour.
void CacheView::colourFaces(const std::string& scalar) {
  chooser_.drop(FunctionChooser::For::kFaces);
  if (!scalar.empty()) return chooser_.ask({FunctionChooser::For::kFaces, scalar, true});
  state_.faces_by.reset();
  ++function_version_;
  changed_ = true;
}

/// Reads a surface on another thread: a file may be large.
void CacheView::readSurface(const fs::path& file) {
  if (reading_surface_.valid()) return say("A surface is being read already.");
  if (state_.surfaces.size() + state_.faces.size() >= kMaxSurfaces)
    return say(fmt::format("There are {} surfaces, and no more can be added.", kMaxSurfaces));
  reading_file_ = file;
  reading_surface_ = std::async(std::launch::async, [file] {
    nameThisThread("surface");
    struct WakeAtEnd {
      ~WakeAtEnd() { Window::wake(); }
    } const at_the_end;
    SurfaceFile surface{file};
    surface.mesh = std::make_shared<TriangleMesh>(readMeshFile(file));
    return surface;
  });
}

void CacheView::takeSurface() {
  if (!reading_surface_.valid() ||
      reading_surface_.wait_for(std::chrono::seconds(0)) != std::future_status::ready)
    return;
  try {
    state_.surfaces.push_back(reading_surface_.get());
    changed_ = true;
  } catch (const Error& error) {
    reports_.report(error);
    dialog_.openAgain({reading_file_}, error.what());
  }
}

/// Takes the function that the chooser has found.
void CacheView::takeFunction() {
  const auto found = chooser_.poll();
  if (!found) return;
  const auto& [question, function] = *found;
  switch (question.what) {
    case FunctionChooser::For::kScalar: {
      EditedFunction chosen = chosenAnew(state_.function, function);
      showScalar(question.scalar);
      state_.function = std::move(chosen);
      state_.suitBackground();
      return;
    }
    case FunctionChooser::For::kOpacities:
      if (question.scalar != state_.variable) state_.opacity_by = OpacityScalar{question.scalar, function};
      break;
    case FunctionChooser::For::kFaces:
      state_.faces_by = FacesScalar{question.scalar, function};
      if (question.scalar == state_.variable) chooseForSheets();
      break;
    case FunctionChooser::For::kSameScalar:
      if (question.scalar == state_.variable) state_.function = function;
      break;
    case FunctionChooser::For::kSameColours:
      if (question.scalar == state_.variable) state_.function = chosenAnew(state_.function, function);
      break;
  }
  state_.suitBackground();
  ++function_version_;
  changed_ = true;
}

}  // namespace curvisplat
