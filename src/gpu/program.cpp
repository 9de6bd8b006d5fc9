#include "gpu/program.h"

#include <fmt/format.h>

#include <string>

#include "base/check.h"

namespace pietra {
namespace {

constexpr std::string_view kHead =
    "#version 450 core\n"
    "#extension GL_ARB_shader_draw_parameters : require\n";

/// `get`: glGetShaderInfoLog or glGetProgramInfoLog.
template <class Get>
std::string logOf(GLuint object, const Get& get) {
    std::string log(4096, '\0');
    GLsizei length = 0;
    get(object, GLsizei(log.size()), &length, log.data());
    log.resize(size_t(length));
    return log;
}

GlShader compile(GlTexts text_of, const GlStage& stage, std::string_view defines) {
    std::string source = fmt::format("{}{}", kHead, defines);
    std::string names;
    for (const std::string_view file : stage.files) {
        const std::string_view text = text_of(file);
        CHECK(!text.empty());
        source += fmt::format("#line 1\n{}", text);
        names += fmt::format(" {}", file);
    }
    GlShader shader(glCreateShader(stage.kind));
    const char* begin = source.c_str();
    glShaderSource(shader, 1, &begin, nullptr);
    glCompileShader(shader);
    GLint done = 0;
    glGetShaderiv(shader, GL_COMPILE_STATUS, &done);
    if (done == 0)
        failCheck(
            __FILE__, __LINE__,
            fmt::format("shader{} does not compile: {}", names, logOf(shader, glGetShaderInfoLog)));
    return shader;
}

}  // namespace

GlProgram makeProgram(GlTexts text_of, std::initializer_list<GlStage> stages,
                      std::string_view defines) {
    GlProgram program(glCreateProgram());
    for (const GlStage& stage : stages) glAttachShader(program, compile(text_of, stage, defines));
    glLinkProgram(program);
    GLint done = 0;
    glGetProgramiv(program, GL_LINK_STATUS, &done);
    if (done == 0)
        failCheck(__FILE__, __LINE__,
                  fmt::format("shaders do not link: {}", logOf(program, glGetProgramInfoLog)));
    return program;
}

}  // namespace pietra
