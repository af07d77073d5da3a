// An OpenGL context to draw in without a window.
#pragma once

#include <string>

#include "render/gl/gl_functions.h"

namespace curvisplat {

/// Current on the thread that made it, and used and destroyed there only.
class GlContext {
 public:
  virtual ~GlContext() = default;
  GlContext(const GlContext&) = delete;
  GlContext& operator=(const GlContext&) = delete;

  const GlFunctions& functions() const { return functions_; }
  /// "OSMesa 22.3.6, llvmpipe (LLVM 15.0.6, 256 bits), OpenGL 4.5"
  const std::string& name() const { return name_; }
  /// Whether the processor draws: no graphics card does.
  bool isSoftware() const { return software_; }

 protected:
  GlContext(const std::string& library, const GlFunctions::Lookup& lookup);

 private:
  GlFunctions functions_;
  std::string name_;
  bool software_ = true;
};

}  // namespace curvisplat
