#include "tools/viewer/point_probe.h"

#include <chrono>
#include <utility>

namespace curvisplat {

void PointProbe::ask(const Question& question, bool again) {
  if (asked_ == question && !again) return;
  asked_ = next_ = question;
}

std::optional<PointProbe::Answer> PointProbe::take() {
  std::optional<Answer> answer;
  if (answering_.valid() && answering_.wait_for(std::chrono::seconds(0)) == std::future_status::ready)
    answer = answering_.get();
  if (next_ && !answering_.valid())
    answering_ = std::async(std::launch::async,
                            [&cache = cache_, question = *std::exchange(next_, std::nullopt)]() -> Answer {
                              const CacheReader reader = cache.at(question.at);
                              const size_t variables[]{question.variable};
                              return {question, probe(reader, variables, question.point)};
                            });
  return answer;
}

}  // namespace curvisplat
