#include "tools/viewer/reports.h"

#include <new>

#include "stream/base/error.h"
#include "stream/base/interrupted.h"
#include "stream/base/message.h"

namespace curvisplat {

bool Reports::attempt(const std::function<void()>& act) {
  try {
    act();
    return true;
  } catch (const Interrupted&) {
    throw;
  } catch (const std::exception& error) {
    report(error);
    return false;
  }
}

void Reports::report(const std::exception& error) {
  if (dynamic_cast<const std::bad_alloc*>(&error))
    return report(
        std::string("out of memory; lower \"memory\" under Detail and memory, or close other programs"));
  report(oneLine(error.what()));
}

void Reports::report(const std::string& text) {
  if (toasts_.add(text, clock_s_(), true)) printMessage("warning: {}", text);
}

}  // namespace curvisplat
