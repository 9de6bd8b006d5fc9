#include "render/gl/draw_programs.h"

#include <fmt/format.h>

#include <string>
#include <vector>

#include "render/gl/shader_text.h"

namespace pietra {
namespace {

constexpr int kScalarColours = 1024;

constexpr const char* kLookDefines[kLooks] = {
    "#define BASE PATCH_COLOUR\n#define LIGHT LIT\n",
    "#define BASE VERTEX_COLOUR\n#define LIGHT LIT\n",
    "#define BASE TRIANGLE_COLOUR\n#define LIGHT LIT\n",
    "#define BASE SCALAR_COLOUR\n#define LIGHT LIT\n",
    "#define BASE PATCH_COLOUR\n#define LIGHT UNLIT\n",
    "#define BASE VERTEX_COLOUR\n#define LIGHT UNLIT\n",
    "#define BASE PATCH_COLOUR\n#define LIGHT NORMALS\n",
    "#define BASE PATCH_COLOUR\n#define LIGHT LIT\n#define WIRE\n",
    "#define BASE VERTEX_COLOUR\n#define LIGHT LIT\n#define WIRE\n",
};

std::string shadingDefines() {
    const auto vector = [](const float(&v)[3]) {
        return fmt::format("vec3({:.6f}, {:.6f}, {:.6f})", v[0], v[1], v[2]);
    };
    return fmt::format(
        "#define KEY_LIGHT {}\n#define SKY_LIGHT {}\n#define GROUND_LIGHT {}\n"
        "#define EYE_LIGHT {:.6f}\n#define SHINE {:.6f}\n"
        "#define WIRE_REACH {:.6f}\n#define WIRE_DARKNESS {:.6f}\n"
        "#define WIRE_LEAST_HEIGHT {:.6f}\n#define WIRE_FADE {:.6f}\n",
        vector(kKeyLight), vector(kSkyLight), vector(kGroundLight), kEyeLight, kShine, kWireReach,
        kWireDarkness, kWireLeastHeight, kWireFade);
}

}  // namespace

Look lookOf(Show show, const VertexLayout& layout) {
    switch (show) {
        case Show::kShaded:
            return layout.colours ? Look::kLitColours : Look::kLit;
        case Show::kColour:
            return layout.colours ? Look::kFlatColours : Look::kFlat;
        case Show::kScalar:
            return layout.scalars > 0 ? Look::kLitScalar : Look::kLit;
        case Show::kTriangles:
            return Look::kLitTriangles;
        case Show::kWire:
            return layout.colours ? Look::kWireColours : Look::kWire;
        case Show::kNormals:
            return Look::kNormals;
        case Show::kDepth:
            return Look::kFlat;  // painted over when the picture is finished
        case Show::kLod:
        case Show::kPatches:
        case Show::kError:
            return Look::kLit;
    }
    return Look::kLit;
}

std::array<GlProgram, kLooks> makeDrawPrograms(int samples) {
    std::array<GlProgram, kLooks> programs;
    const GlStage vertex{GL_VERTEX_SHADER,
                         {"frame_block.glsl", "srgb.glsl", "patch_draw.vert.glsl"}};
    const GlStage wire{GL_GEOMETRY_SHADER, {"frame_block.glsl", "patch_wire.geom.glsl"}};
    const GlStage fragment{GL_FRAGMENT_SHADER,
                           {"frame_block.glsl", "srgb.glsl", "patch_draw.frag.glsl"}};
    for (size_t i = 0; i < kLooks; ++i) {
        const std::string defines =
            fmt::format("{}#define SAMPLES {}\n{}", kLookDefines[i], samples, shadingDefines());
        programs[i] = Look(i) < Look::kWire ? makeProgram({vertex, fragment}, defines)
                                            : makeProgram({vertex, wire, fragment}, defines);
    }
    return programs;
}

GlTexture makeScalarColours() {
    GLuint name = 0;
    glCreateTextures(GL_TEXTURE_1D, 1, &name);
    GlTexture texture(name);
    std::vector<Vec3f> colours;
    for (int i = 0; i < kScalarColours; ++i)
        colours.push_back(scalarColour(float(i) / (kScalarColours - 1)));
    glTextureStorage1D(texture, 1, GL_RGBA32F, kScalarColours);
    glBindBuffer(GL_PIXEL_UNPACK_BUFFER, 0);
    glTextureSubImage1D(texture, 0, 0, kScalarColours, GL_RGB, GL_FLOAT, colours.data());
    glTextureParameteri(texture, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTextureParameteri(texture, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    glTextureParameteri(texture, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    return texture;
}

}  // namespace pietra
