// Criterion. What floats leave open is decided by doubles, which hold these integers exactly below
// 2^53 and keep the order of those above and below it.

const double kOutside = 8.0lf;
const uint kHiddenBits = 3u;
const double kSideUnit = 1.0lf / 16384.0lf;

layout(std430, binding = 8) readonly buffer CriterionBlock {
    ivec4 eye;
    ivec4 side[4];
    int reach[256];
    uint hides_backs;
};

uint decodeRadius(uint code) {
    const uint exponent = code >> 11;
    return exponent == 0u ? code : (2048u | (code & 2047u)) << (exponent - 1u);
}

bool showsExactly(ivec3 from_eye, int reach_of_error, uint radius_code) {
    const dvec3 d = dvec3(from_eye);
    const double radius = double(decodeRadius(radius_code));
    const double distance = double(reach_of_error) + radius;
    const double squared = d.x * d.x + d.y * d.y + d.z * d.z;
    if (distance * distance <= squared) return false;
    double inside = 0.0lf;
    for (int i = 0; i < 4; ++i) {
        const dvec3 n = dvec3(side[i].xyz);
        const double depth = floor((n.x * d.x + n.y * d.y + n.z * d.z) * kSideUnit);
        inside = min(inside, depth + radius);
    }
    const double rest = distance + kOutside * inside;
    return rest > 0.0lf && rest * rest > squared;
}

bool shows(ivec3 from_eye, int reach_of_error, uint radius_code) {
    // Relative errors are below 2^-20: a few roundings to 24 bits.
    const vec3 d = vec3(from_eye);
    const float squared = d.x * d.x + d.y * d.y + d.z * d.z;
    const float radius = float(decodeRadius(radius_code));
    const float distance = float(reach_of_error) + radius, limit = distance * distance;
    const float above = 1.0 + 1.0 / 524288.0;
    if (limit * above < squared) return false;
    float depth = radius;
    for (int i = 0; i < 4; ++i) {
        const vec3 n = vec3(side[i].xyz) * (1.0 / 16384.0);
        depth = min(depth, n.x * d.x + n.y * d.y + n.z * d.z + radius);
    }
    if (limit > squared * above && depth >= distance * (1.0 / 524288.0) + 2.0) return true;
    return showsExactly(from_eye, reach_of_error, radius_code);
}

/// Coordinate k of a box of normals: the least, and the largest with an offset of 4 bits.
int boundOf(uint normals, int k, int bits) {
    return bitfieldExtract(int(normals), 8 * k + bits, 4);
}
bool facesAway(ivec3 from_eye, uint radius_code, uint normals) {
    int along = 0;
    for (int k = 0; k < 3; ++k)
        along += min(boundOf(normals, k, 0) * from_eye[k], boundOf(normals, k, 4) * from_eye[k]);
    return 2 * along > int(normals >> 24) * int(decodeRadius(radius_code));
}

/// criterion: radius | error << 16, then the box of normals.
bool needs(ivec3 centre, uvec2 criterion) {
    const uint radius_code = criterion.x & 0xffffu, error = criterion.x >> 16;
    const ivec3 from_eye = centre - eye.xyz;
    if (!shows(from_eye, reach[error], radius_code)) return false;
    if (hides_backs == 0u || shows(from_eye, reach[error] >> kHiddenBits, radius_code)) return true;
    return !facesAway(from_eye, radius_code, criterion.y);
}
bool needsLast(ivec3 centre, uvec2 criterion) {
    return (criterion.x & kBlocked) != 0u || needs(centre, criterion);
}
