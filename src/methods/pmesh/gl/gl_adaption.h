#pragma once
// Adaption on the GPU, by compute shaders of OpenGL 4.5: the same passes, the same arrays after
// each frame, byte for byte (adaption.h). All operations are in its memory.
//
// A frame is a fixed list of steps that find their work in the GPU's own counts: nothing waits for
// an answer. What a frame has done can be asked for when the GPU has come to it.
//
// The shaders follow adaption.cpp and active_mesh.cpp function by function, by the same names; what
// differs:
//   - sets are taken in the order of the vertices by counts of a block; those whose order does not
//     matter (fresh, released) are queues
//   - rounds of forced marks: one of many groups, then one group until there are none
//   - what comes free goes to rings.
// 64 bytes a vertex and 32 a face are the mesh, 32 an operation; 90 a vertex are for finding work.
//
// Needs the context in which it was made, current; also to be destroyed.

#include <array>
#include <cstdint>
#include <functional>

#include "gpu/program.h"
#include "methods/pmesh/adaption.h"

namespace pietra::pmesh {

class GlAdaption {
public:
    /// The base mesh; validate() and validateStars() must find no fault in `mesh`, all of which
    /// must be loaded. It is not used afterwards. `groups`: as many as fill the GPU. Throws
    /// MemoryError where the driver has too little.
    explicit GlAdaption(const ProgressiveMesh& mesh, uint32_t groups = 2048);

    /// Adaption::frame(); returns before the GPU has done it, but waits for the frame before.
    void frame(const Criterion& criterion, int most_passes);
    /// Adaption::settle(): waits now and then for what the GPU has to say.
    PassCounts settle(const Criterion& criterion);
    /// Of the last frame; waits for it.
    PassCounts lastCounts();

    /// Vertices and faces that there are after the last frame; waits for it.
    struct Size {
        uint32_t vertices, faces;
    };
    Size size();
    /// Copies the arrays to those of `mesh`, which is of the same source.
    void download(ActiveMesh& mesh);

    /// If set, called with each step's name after it has been given to the GPU: to time them.
    std::function<void(const char* step)> after_step;

    /// Vertex and ActiveFace, as many as size() tells.
    GLuint vertexBuffer() const { return vertex_; }
    GLuint faceBuffer() const { return face_; }

private:
    struct State;
    void makePrograms();
    void makePlaces(const ProgressiveMesh& mesh);
    void upload(const ProgressiveMesh& mesh);
    void bind();
    void begin(const Criterion& criterion);
    void pass(uint32_t index, bool is_last);
    void finish();
    struct Step {
        const char* name;
        GlProgram program;
    };
    void run(const Step& step, uint32_t pass, uint32_t argument, uint32_t groups);
    void sortInSpace();
    void tell();
    const State& told();

    const uint32_t groups_;
    uint32_t vertex_capacity_ = 0, face_capacity_ = 0;
    GlBuffer vertex_, pulse_, criteria_, record_, face_, operation_, state_, work_, criterion_;
    GlBuffer places_, told_;
    const State* told_memory_ = nullptr;
    GlFence fence_;
    Wear wear_;
    Step scan_, look_, begin_, evaluate_, list_, apply_, tidy_, sort_;
};

}  // namespace pietra::pmesh
