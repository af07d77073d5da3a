// The frames of a command: the camera and the time step of each, and which of them one process draws. Shared
// by the subcommands and the Python package.
//
//   CameraArguments   --view or --position, --azimuth, --orbit, --path, ...   --> CameraMotion --+
//   StepArguments     --step, --time, --steps, --interpolate                  --> chosenSteps() -+-> inTime(): MotionInTime
//   FramePart         --part, or ranks                                        --> the frames that this process draws
//
// The arguments hold values as given; they are checked before a cache is opened. Motions keep no state: any
// thread may ask for any frame.
#pragma once

#include <CLI/CLI.hpp>
#include <glm/vec3.hpp>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "render/camera/camera.h"
#include "render/film/film.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/series.h"

namespace curvisplat {

inline constexpr unsigned kMaxFrames = 100'000;  // limit of --frames
inline constexpr unsigned kDefaultFrames = 90;   // of an orbit or a path

/// Options that choose cameras, as given; checked and parsed later.
struct CameraArguments {
  std::optional<std::string> view, position, focal_point, view_up, parallel_scale, view_angle, orbit;
  std::optional<std::string> look_at, from_height;  // above a globe: placedAbove() makes a position of them
  std::optional<std::string> azimuth, elevation, roll, zoom;  // on top of the others
  std::optional<uint64_t> frames;
  std::filesystem::path path;
  std::shared_ptr<const Film> film = nullptr;  // of `path`, where it has been read already

  /// Whether they place the camera, rather than change the place that is chosen from the data. An orbit begins there.
  bool place() const {
    return view || position || focal_point || view_up || parallel_scale || view_angle || look_at ||
           !path.empty();
  }
  bool turn() const { return azimuth || elevation || roll; }
  bool moves() const { return orbit || !path.empty(); }
  uint64_t frameCount() const { return frames.value_or(moves() ? kDefaultFrames : 1); }
};

/// Adds --view, --view-angle, --azimuth, --elevation, --roll and --zoom under the heading `group`. `note` ends the help of
/// --view.
void addCameraOptions(CLI::App& command, CameraArguments& arguments, const std::string& group,
                      const std::string& note);

/// Adds --position, --focal-point, --view-up and --parallel-scale under the heading `group`.
void addPlaceOptions(CLI::App& command, CameraArguments& arguments, const std::string& group);

/// Throws UsageError if options contradict each other; needs no cache.
void checkCameraArguments(const CameraArguments& arguments);

/// The box that a picture has to show, after --scale.
struct ShownBox {
  glm::dvec3 lower{0.0}, upper{0.0};
};

/// One camera per frame.
struct CameraMotion {
  uint64_t frames = 1;
  std::function<Camera(uint64_t frame)> camera;
  /// The series' time at a frame, if the path's key frames have times; else an empty function.
  std::function<double(uint64_t frame)> series_time;
  /// The function and cuts of a film at a frame, if it states any; else an empty function.
  std::function<KeyLook(uint64_t frame)> look = {};
};

/// The scale at which an orthographic camera shows the whole box in all its frames; nullopt where the arguments leave no
/// scale open. Requires and throws as chooseCameraMotion().
std::optional<double> fittingScale(const CameraArguments& arguments, const ShownBox& box, ImageSize size);

/// The camera of each frame. Requires that checkCameraArguments() accepted the arguments. What they leave
/// open is chosen so that the whole box is seen. Azimuth, elevation, orbit, roll and zoom change the camera
/// in this order. An orbit of 360 degrees is a loop: its last frame is one step before the first. A path's
/// last frame is at its last key frame. Throws UsageError, or Error if the path file is invalid.
CameraMotion chooseCameraMotion(const CameraArguments& arguments, const ShownBox& box, ImageSize size);

/// Options that choose time steps of a cache, as given; checked and parsed later.
struct StepArguments {
  std::optional<uint64_t> step;
  std::optional<std::string> time, steps;
  bool interpolates = false;

  bool severalSteps() const { return steps.has_value(); }
};

/// Adds --step and --time under the heading `group`.
void addStepOptions(CLI::App& command, StepArguments& arguments, const std::string& group);
/// Adds --interpolate.
void addInterpolateOption(CLI::App& command, StepArguments& arguments, const std::string& group);

/// The steps to draw, in order: one, unless --steps was given. Throws UsageError if options contradict each
/// other or the cache has no such step.
std::vector<StepPosition> chosenSteps(const StepArguments& arguments, const CacheReader& cache);

/// The cache with the scalar `scalar` (CacheReader::ofScalar()) at the first of its chosen steps. Throws
/// Error as CacheReader, and UsageError as chosenSteps().
CacheReader openAtStep(const std::filesystem::path& path, const StepArguments& arguments,
                       std::string_view scalar = {});

/// Checks the options of a command that draws series, in place of checkCameraArguments(). Also throws
/// UsageError if --interpolate has nothing to interpolate, or --frames nothing to spread.
void checkMotionArguments(const CameraArguments& camera, const StepArguments& steps);

/// A camera and a time per frame.
struct MotionInTime {
  uint64_t frames = 1;
  std::function<Camera(uint64_t frame)> camera;
  std::function<StepPosition(uint64_t frame)> position;
  std::function<KeyLook(uint64_t frame)> look = {};  // as CameraMotion
};

/// The arguments with a frame for each of several time steps, if the camera moves and --frames does not say
/// how many.
CameraArguments framesOf(const CameraArguments& arguments, const std::vector<StepPosition>& steps);

/// The motion through a series, which must outlive it. A path whose key frames have times follows these.
/// Otherwise the chosen steps are spread evenly over the frames, or with --interpolate the time from the
/// first to the last of them. A camera that does not move gets a frame for each step, or as many as --frames
/// says. Throws UsageError if a path's times contradict options.
MotionInTime inTime(const CameraMotion& motion, const Series& series, const StepArguments& arguments,
                    const std::vector<StepPosition>& chosen, std::optional<uint64_t> frames);

/// The frames that one of `count` processes draws. They are dealt out in turn, since neighbours take about
/// the same time.
struct FramePart {
  uint64_t index = 0;  // from 0
  uint64_t count = 1;

  /// The frames index, index + count, index + 2 count, ... of 0 .. frames - 1.
  std::vector<uint64_t> of(uint64_t frames) const;
};

/// Parses "i/n" with i from 1 to n. Throws UsageError.
FramePart parsePart(const std::string& text);

}  // namespace curvisplat
