// Wavefront OBJ: vertices and faces may take turns, so nothing waits. Numbers are written with as
// few digits as give the same float (or double) back.

#include <fmt/format.h>

#include "io/mesh_writers.h"

namespace pietra {

namespace {

class ObjWriter : public MeshWriter {
public:
    ObjWriter(const std::string& path, bool force, const MeshOutput& output)
        : MeshWriter(output), file_(path, force), out_(file_.file()) {
        if (!output.comment.empty()) out_.write("# " + output.comment + "\n");
    }

    void finish() override {
        out_.flush();
        file_.commit();
    }

    std::vector<std::string> notes() const override {
        if (output_.schema.scalars.empty()) return {};
        return {"an OBJ file holds no scalar attributes: they are left out"};
    }

protected:
    void checkCounts(uint64_t, uint64_t) const override {}

    void putVertices(const VertexBatch& batch) override {
        for (size_t i = 0; i < batch.position.size(); ++i) {
            text_.clear();
            const Vec3d& p = batch.position[i];
            if (output_.double_positions) {
                add("v {} {} {}", p.x, p.y, p.z);
            } else {
                add("v {} {} {}", float(p.x), float(p.y), float(p.z));
            }
            if (output_.schema.colours) {
                const Rgba8& c = batch.colour[i];
                add(" {:.4f} {:.4f} {:.4f}", c.r / 255.0, c.g / 255.0, c.b / 255.0);
            }
            text_.push_back('\n');
            if (output_.schema.normals_given) {
                const Vec3f& n = batch.normal[i];
                add("vn {} {} {}\n", n.x, n.y, n.z);
            }
            putText();
        }
    }

    void putTriangles(std::span<const std::array<uint64_t, 3>> triangles) override {
        for (const auto& t : triangles) {
            text_.clear();
            const uint64_t a = t[0] + 1, b = t[1] + 1, c = t[2] + 1;
            if (output_.schema.normals_given)
                add("f {0}//{0} {1}//{1} {2}//{2}\n", a, b, c);
            else
                add("f {} {} {}\n", a, b, c);
            putText();
        }
    }

private:
    template <class... Values>
    void add(fmt::format_string<Values...> format, Values&&... values) {
        fmt::format_to(fmt::appender(text_), format, std::forward<Values>(values)...);
    }
    void putText() { std::memcpy(out_.put(text_.size()), text_.data(), text_.size()); }

    AtomicFile file_;
    OutputBuffer out_;
    fmt::memory_buffer text_;
};

}  // namespace

std::unique_ptr<MeshWriter> createObj(const std::string& path, bool force,
                                      const MeshOutput& output) {
    return std::make_unique<ObjWriter>(path, force, output);
}

}  // namespace pietra
