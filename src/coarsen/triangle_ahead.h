#pragma once
// The triangles of a source in large batches, read by another thread while one is being worked on.

#include <tbb/task_group.h>

#include <array>
#include <cstdint>
#include <vector>

#include "base/task_order.h"
#include "io/triangle_source.h"

namespace pietra {

class TriangleAhead {
public:
    /// Begins at the first triangle. Batches have `most` triangles or, in small meshes, a sixteenth
    /// of them; two exist at a time, of 24 bytes a triangle.
    TriangleAhead(TriangleSource& source, size_t most);
    /// Waits for what is being read. The source must outlive this.
    ~TriangleAhead();
    TriangleAhead(const TriangleAhead&) = delete;
    TriangleAhead& operator=(const TriangleAhead&) = delete;

    /// Overwrites `index`; false when there are none left. Throws what reading throws.
    bool next(std::vector<std::array<uint64_t, 3>>& index);

private:
    void begin();
    void wait();
    void readMore();

    TriangleSource& source_;
    size_t count_;
    TriangleBatch batch_;  // what the source gave last, from begin_ on still to be taken
    size_t begin_ = 0;
    std::vector<std::array<uint64_t, 3>> ahead_;
    tbb::task_group task_;
    TaskOrder order_;  // of the task
};

}  // namespace pietra
