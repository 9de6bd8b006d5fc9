#include <algorithm>
#include <cmath>
#include <optional>

#include "base/check.h"
#include "base/stopwatch.h"
#include "gpu/context.h"
#include "render/gl/renderer.h"
#include "render/offline/batch_drawer.h"
#include "render/offline/gl_thread.h"

namespace pietra {
namespace {

class GlDrawer : public BatchDrawer {
public:
    GlDrawer(const View& view, const Lattice& lattice, const DrawerSettings& settings) {
        statistics_.device_bytes = settings.batch_bytes;
        thread_.run([&] {
            context_.emplace(GlContext::headless());
            renderer_.emplace(view.size(), settings.samples, settings.batch_bytes);
            renderer_->begin(view, lattice, settings.shade);
        });
    }
    ~GlDrawer() override {
        thread_.run([&] {
            renderer_.reset();
            context_.reset();
        });
    }

    void setModel(const View& view, const Lattice& lattice) override {
        timed([&] {
            drawBatch();
            renderer_->setModel(view, lattice);
        });
    }

    void add(std::vector<Mesh> patches, std::vector<DrawPatch> list) override {
        timed([&] {
            const PageKey key{0, pages_};
            if (!renderer_->upload(key, patches)) {
                drawBatch();
                CHECK(renderer_->upload(key, patches));  // see leastGlBatchBytes()
            }
            ++pages_;
            for (uint32_t i = 0; i < list.size(); ++i) {
                list[i].page = key;
                list[i].patch = i;
                batch_.push_back(list[i]);
            }
            statistics_.patches += list.size();
            statistics_.held_bytes = std::max(statistics_.held_bytes, renderer_->usedBytes());
        });
    }

    Picture finish() override {
        Picture picture;
        timed([&] {
            drawBatch();
            picture = renderer_->readPicture();
        });
        statistics_.triangles = renderer_->statistics().triangles;
        for (const float depth : picture.depth) statistics_.pixels_covered += std::isfinite(depth);
        return picture;
    }

private:
    template <class Body>
    void timed(const Body& body) {
        const Stopwatch watch;
        thread_.run(body);
        statistics_.draw_ms += watch.ms();
    }

    void drawBatch() {
        renderer_->draw(batch_);
        batch_.clear();
        for (; first_page_ < pages_; ++first_page_) renderer_->release({0, first_page_});
    }

    GlThread thread_;
    std::optional<GlContext> context_;
    std::optional<GlRenderer> renderer_;
    std::vector<DrawPatch> batch_;
    uint32_t first_page_ = 0, pages_ = 0;  // numbers of the pages there are
};

}  // namespace

std::unique_ptr<BatchDrawer> makeGlDrawer(const View& view, const Lattice& lattice,
                                          const DrawerSettings& settings) {
    return std::make_unique<GlDrawer>(view, lattice, settings);
}

size_t leastGlBatchBytes(size_t largest_page_bytes) {
    // A page takes less there than decoded, but for alignment; a sixth is not for pages.
    return std::max(kLeastVramBytes, (largest_page_bytes + 4096) * 6 / 5 + 4096);
}

}  // namespace pietra
