#pragma once
// Small owners of OpenGL's objects, and programs made from files of text. All need a
// current context, also to be destroyed.

#include <epoxy/gl.h>

#include <initializer_list>
#include <span>
#include <string_view>
#include <utility>

namespace pietra {

/// Move-only owner of a name; `destroy` is called with it unless it is 0.
template <auto destroy, class Name = GLuint>
class GlObject {
public:
    GlObject() = default;
    explicit GlObject(Name name) : name_(name) {}
    GlObject(GlObject&& other) noexcept : name_(std::exchange(other.name_, Name{})) {}
    GlObject& operator=(GlObject&& other) noexcept {
        std::swap(name_, other.name_);
        return *this;
    }
    ~GlObject() {
        if (name_ != Name{}) destroy(name_);
    }
    operator Name() const { return name_; }

private:
    Name name_{};
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

inline void deleteFence(GLsync name) {
    glDeleteSync(name);
}

using GlBuffer = GlObject<deleteBuffer>;
using GlTexture = GlObject<deleteTexture>;
using GlFramebuffer = GlObject<deleteFramebuffer>;
using GlVertexArray = GlObject<deleteVertexArray>;
using GlQuery = GlObject<deleteQuery>;
using GlProgram = GlObject<deleteProgram>;
using GlShader = GlObject<deleteShader>;
using GlFence = GlObject<deleteFence, GLsync>;

/// One stage of a program: files of text, read one after the other.
struct GlStage {
    GLenum kind;
    std::initializer_list<std::string_view> files;
};

/// The text of a file that CMake has put into the program (cmake/embed_text.cmake); empty where
/// there is none.
using GlTexts = std::string_view (*)(std::string_view name);

/// Compiles and links. `defines`: lines put before the files of each stage. A shader that does not
/// compile is a bug of Pietra, or of the driver: throws BugError with the driver's words.
GlProgram makeProgram(GlTexts text_of, std::initializer_list<GlStage> stages,
                      std::string_view defines = {});

}  // namespace pietra
