#pragma once
// For tests of this folder: a context without a window, or a test that is skipped; whatever the
// driver has to say fails the test.

#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "gpu/context.h"

namespace pietra {

class GlTest : public ::testing::Test {
protected:
    void SetUp() override {
        try {
            context_.emplace(GlContext::headless(
                [this](const GlMessage& message) { said_.push_back(message.text); }));
        } catch (const UsageError& error) {
            GTEST_SKIP() << error.what();
        }
    }
    void TearDown() override {
        for (const std::string& text : said_) ADD_FAILURE() << "the driver says: " << text;
    }

    std::vector<std::string> said_;
    std::optional<GlContext> context_;
};

}  // namespace pietra
