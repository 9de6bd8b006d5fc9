#pragma once
// Small owners of OpenGL's objects, and programs made from the files of shaders/. All need a
// current context, also to be destroyed.

#include <epoxy/gl.h>

#include <initializer_list>
#include <span>
#include <string_view>
#include <utility>

namespace pietra {

/// Move-only owner of a name; `destroy` is called with it unless it is 0.
template <void (*destroy)(GLuint)>
class GlObject {
public:
    GlObject() = default;
    explicit GlObject(GLuint name) : name_(name) {}
    GlObject(GlObject&& other) noexcept : name_(std::exchange(other.name_, 0)) {}
    GlObject& operator=(GlObject&& other) noexcept {
        std::swap(name_, other.name_);
        return *this;
    }
    ~GlObject() {
        if (name_ != 0) destroy(name_);
    }
    operator GLuint() const { return name_; }

private:
    GLuint name_ = 0;
};

inline void deleteBuffer(GLuint name) {
    glDeleteBuffers(1, &name);
}
inline void deleteTexture(GLuint name) {
    glDeleteTextures(1, &name);
}
inline void deleteFramebuffer(GLuint name) {
    glDeleteFramebuffers(1, &name);
}
inline void deleteVertexArray(GLuint name) {
    glDeleteVertexArrays(1, &name);
}
inline void deleteQuery(GLuint name) {
    glDeleteQueries(1, &name);
}
inline void deleteProgram(GLuint name) {
    glDeleteProgram(name);
}
inline void deleteShader(GLuint name) {
    glDeleteShader(name);
}

using GlBuffer = GlObject<deleteBuffer>;
using GlTexture = GlObject<deleteTexture>;
using GlFramebuffer = GlObject<deleteFramebuffer>;
using GlVertexArray = GlObject<deleteVertexArray>;
using GlQuery = GlObject<deleteQuery>;
using GlProgram = GlObject<deleteProgram>;
using GlShader = GlObject<deleteShader>;

/// One stage of a program: files of shaders/, read one after the other.
struct GlStage {
    GLenum kind;
    std::initializer_list<std::string_view> files;
};

/// Compiles and links. `defines`: lines put before the files of each stage. A shader that does not
/// compile is a bug of Pietra, or of the driver: throws BugError with the driver's words.
GlProgram makeProgram(std::initializer_list<GlStage> stages, std::string_view defines = {});

}  // namespace pietra
