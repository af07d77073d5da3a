// What the data are at a point, found on another thread: the newest question is answered, older ones are dropped.
#pragma once

#include <future>
#include <optional>

#include "stream/cache/cache_reader.h"
#include "stream/cache/probe.h"

namespace curvisplat {

class PointProbe {
 public:
  /// `cache` must outlive it.
  explicit PointProbe(const CacheReader& cache) : cache_(cache) {}

  struct Question {
    glm::dvec3 point{0.0};  // data coordinates
    size_t variable = 0;
    StepPosition at;
    bool operator==(const Question&) const = default;
  };
  struct Answer {
    Question question;
    std::optional<ProbeResult> found;  // nullopt: outside of the data
  };

  /// Nothing happens if this was the newest question already, unless it is asked `again`.
  void ask(const Question& question, bool again = false);
  /// An answer that has come since the last call. Throws what reading throws. Call it often: it begins to answer what
  /// was asked meanwhile.
  std::optional<Answer> take();
  bool busy() const { return answering_.valid() || next_; }

 private:
  const CacheReader& cache_;
  std::optional<Question> asked_, next_;
  std::future<Answer> answering_;
};

}  // namespace curvisplat
