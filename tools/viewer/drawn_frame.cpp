#include "tools/viewer/drawn_frame.h"

#include <imgui.h>

#include <span>

#include "stream/base/checksum.h"

namespace curvisplat {
namespace {

template <class T>
void addVector(Checksum& sum, const ImVector<T>& values) {
  sum.add(std::as_bytes(std::span(values.Data, static_cast<size_t>(values.Size))));
}

}  // namespace

uint64_t appearanceOf(const ImDrawData& frame) {
  Checksum sum;
  const auto add = [&](const auto& value) { sum.add(std::as_bytes(std::span(&value, 1))); };
  add(frame.DisplayPos);
  add(frame.DisplaySize);
  add(frame.FramebufferScale);
  for (const ImDrawList* list : std::span(frame.CmdLists, static_cast<size_t>(frame.CmdListsCount))) {
    for (const ImDrawCmd& command : list->CmdBuffer) {
      add(command.ClipRect);
      add(command.TextureId);
      add(command.VtxOffset);
      add(command.IdxOffset);
      add(command.ElemCount);
    }
    addVector(sum, list->VtxBuffer);
    addVector(sum, list->IdxBuffer);
  }
  return sum.value();
}

}  // namespace curvisplat
