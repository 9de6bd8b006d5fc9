#pragma once
// Colours by height: a table of steps, linear between them.

#include <cstddef>
#include <span>

#include "geometry/mesh.h"

namespace pietra {

struct ColourStep {
    double value;
    uint8_t r, g, b;
};

inline Rgba8 blendColours(const Rgba8& a, const Rgba8& b, double t) {
    const auto blend = [t](uint8_t from, uint8_t to) {
        return uint8_t(from + (double(to) - from) * t + 0.5);
    };
    return {blend(a.r, b.r), blend(a.g, b.g), blend(a.b, b.b), 255};
}

/// `steps` ascend; beyond the ends the end's colour holds. Two steps of one value make an edge.
inline Rgba8 colourAt(std::span<const ColourStep> steps, double value) {
    const auto colour = [](const ColourStep& s) { return Rgba8{s.r, s.g, s.b, 255}; };
    if (value <= steps.front().value) return colour(steps.front());
    for (size_t i = 1; i < steps.size(); ++i)
        if (value < steps[i].value)
            return blendColours(
                colour(steps[i - 1]), colour(steps[i]),
                (value - steps[i - 1].value) / (steps[i].value - steps[i - 1].value));
    return colour(steps.back());
}

}  // namespace pietra
