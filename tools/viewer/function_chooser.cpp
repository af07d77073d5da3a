#include "tools/viewer/function_chooser.h"

#include <chrono>
#include <utility>

#include "stream/base/thread_name.h"
#include "tools/viewer/first_view.h"

namespace curvisplat {

void FunctionChooser::ask(Question question) {
  wanted_ = true;
  next_ = std::move(question);
  if (!answering_.valid()) begin();
}

void FunctionChooser::drop() {
  wanted_ = false;
  next_.reset();
}

void FunctionChooser::begin() {
  answering_ =
      std::async(std::launch::async,
                 [&cache = cache_, wake = wake_, question = *std::exchange(next_, std::nullopt)]() -> Answer {
                   nameThisThread("function");
                   struct Wake {
                     void (*call)();
                     ~Wake() { call(); }
                   } const at_the_end{wake};
                   return {question, automaticFunction(cache, question.scalar)};
                 });
}

std::optional<FunctionChooser::Answer> FunctionChooser::take() {
  if (!answering_.valid() || answering_.wait_for(std::chrono::seconds(0)) != std::future_status::ready)
    return std::nullopt;
  std::future<Answer> answered = std::move(answering_);
  if (next_) {
    begin();
    return std::nullopt;
  }
  if (!std::exchange(wanted_, false)) return std::nullopt;
  return answered.get();
}

}  // namespace curvisplat
