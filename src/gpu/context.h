#pragma once
// An OpenGL 4.5 core context: one of its own without a window, through EGL, or the one that a
// window has made current. Its functions are those of <epoxy/gl.h>.
//
// Without a window every EGL device is tried, hardware before software, then Mesa's surfaceless
// platform. Libraries are looked for when a context is asked for, so a program that asks for none
// runs where there are none. Not thread-safe: a context is used by the thread it is current in.

#include <functional>
#include <memory>
#include <string>

namespace pietra {

struct GlMessage {
    std::string text;
    bool error;  ///< misuse or worse; else a hint, as on speed
};
/// Called from within OpenGL calls, in the thread that makes them; must not throw.
using GlMessageHandler = std::function<void(const GlMessage&)>;

class GlContext {
public:
    /// A context without a window, current in this thread. With a handler the driver is asked to
    /// check what it is told, which may cost time; notes of no severity are left out. Throws
    /// UsageError, which says what was found and what it lacks, where there is no OpenGL 4.5 with
    /// the extensions that GlRenderer needs.
    static GlContext headless(GlMessageHandler handler = {});
    /// The context that is current in this thread, which must outlive this. Throws likewise.
    static GlContext adoptCurrent(GlMessageHandler handler = {});

    GlContext(GlContext&&) noexcept;
    GlContext& operator=(GlContext&&) noexcept;
    ~GlContext();

    /// Makes a headless context current in this thread; does nothing for an adopted one.
    void makeCurrent();
    /// Leaves this thread without a context, so that another thread may make it current; does
    /// nothing for an adopted one.
    void leave();
    /// The driver's name for itself, and for its version.
    const std::string& renderer() const;
    const std::string& version() const;

private:
    struct State;
    explicit GlContext(std::unique_ptr<State> state);
    std::unique_ptr<State> state_;
};

}  // namespace pietra
