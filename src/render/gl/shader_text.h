#pragma once
// The files of shaders/, as CMake puts them into the program.

#include "gpu/program.h"

namespace pietra {

/// The text of shaders/NAME; empty where there is no such file.
std::string_view drawingText(std::string_view name);

inline GlProgram makeProgram(std::initializer_list<GlStage> stages, std::string_view defines = {}) {
    return makeProgram(drawingText, stages, defines);
}

}  // namespace pietra
