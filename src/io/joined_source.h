#pragma once
// Several triangle sources as one: their vertices and triangles one after the other, in the order
// given, whatever their formats. Vertices at one place are not merged here: the builder does that.
//
// Attributes: colours are kept where any source has them, and the vertices of the others are white.
// Normals and scalars are kept where all have them, since there is nothing to put in their place; a
// note names what is left out, and the first source without it. Memory: that of one source being
// read, and what each keeps beside its window.

#include <memory>
#include <string>
#include <vector>

#include "io/triangle_source.h"

namespace pietra {

struct SourcePart {
    std::string name;  ///< as notes and messages say it
    std::unique_ptr<TriangleSource> source;
};

/// Throws InputError where the counts of all together overflow.
std::unique_ptr<TriangleSource> joinSources(std::vector<SourcePart> parts);

}  // namespace pietra
