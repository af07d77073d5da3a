#include "tools/viewer/opening.h"

#include <utility>

namespace curvisplat {

Opening::Opening(std::string title, Work work, void (*wake)())
    : job_(
          std::move(title), "reading",
          [this, wake, work = std::move(work)](Progress& progress) {
            OpeningEvents events;
            events.say = [this](const std::string& text) {
              const MutexLock lock(mutex_);
              messages_.push_back(text);
            };
            events.reorder = [this](const std::vector<std::filesystem::path>& files) {
              const MutexLock lock(mutex_);
              files_ = files;
            };
            events.preview = [this, wake](Preview preview) {
              {
                const MutexLock lock(mutex_);
                preview_ = std::move(preview);
              }
              wake();
            };
            return work(progress, events);
          },
          wake) {}

std::vector<std::string> Opening::takeMessages() {
  const MutexLock lock(mutex_);
  return std::exchange(messages_, {});
}

std::vector<std::filesystem::path> Opening::takeFiles() {
  const MutexLock lock(mutex_);
  return std::exchange(files_, {});
}

std::optional<Preview> Opening::takePreview() {
  const MutexLock lock(mutex_);
  return std::exchange(preview_, std::nullopt);
}

}  // namespace curvisplat
