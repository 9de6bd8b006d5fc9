#include "gpu/context.h"

#include <epoxy/gl.h>
#include <gtest/gtest.h>

#include <thread>

#include "gpu/test_context.h"

namespace pietra {
namespace {

class GlContextTest : public GlTest {};

TEST_F(GlContextTest, SaysWhatItIs) {
    EXPECT_FALSE(context_->renderer().empty());
    EXPECT_FALSE(context_->version().empty());
    EXPECT_GE(epoxy_gl_version(), 45);
}

TEST_F(GlContextTest, HandsOverWhatTheDriverSays) {
    glEnable(0xffff);
    ASSERT_EQ(said_.size(), 1u);
    EXPECT_NE(said_[0].find("glEnable"), std::string::npos) << said_[0];
    said_.clear();
    while (glGetError() != GL_NO_ERROR) {
    }
}

TEST_F(GlContextTest, AdoptsTheOneThatIsCurrent) {
    const GlContext adopted = GlContext::adoptCurrent();
    EXPECT_EQ(adopted.renderer(), context_->renderer());
}

TEST_F(GlContextTest, SeveralTakeTurns) {
    GlContext other = GlContext::headless();
    GLuint name = 0;
    glCreateBuffers(1, &name);
    EXPECT_TRUE(glIsBuffer(name));
    context_->makeCurrent();
    EXPECT_FALSE(glIsBuffer(name));
    other.makeCurrent();
    EXPECT_TRUE(glIsBuffer(name));
}

TEST_F(GlContextTest, GoesFromThreadToThread) {
    GLuint name = 0;
    glCreateBuffers(1, &name);
    context_->leave();
    std::thread([&] {
        context_->makeCurrent();
        EXPECT_TRUE(glIsBuffer(name));
        glDeleteBuffers(1, &name);
        context_->leave();
    }).join();
    context_->makeCurrent();
    EXPECT_FALSE(glIsBuffer(name));
}

}  // namespace
}  // namespace pietra
