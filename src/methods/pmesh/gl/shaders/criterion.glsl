// Criterion. What floats leave open is decided by doubles, which hold these integers exactly below
// 2^53 and keep the order of those above and below it.

const double kOutside = 8.0lf;
const double kSideUnit = 1.0lf / 16384.0lf;

layout(std430, binding = 8) readonly buffer CriterionBlock {
    ivec4 eye;
    ivec4 side[4];
    int reach[256];
};

uint decodeRadius(uint code) {
    const uint exponent = code >> 11;
    return exponent == 0u ? code : (2048u | (code & 2047u)) << (exponent - 1u);
}

bool needsExactly(ivec3 from_eye, uint error, uint radius_code) {
    const dvec3 d = dvec3(from_eye);
    const double radius = double(decodeRadius(radius_code));
    const double distance = double(reach[error]) + radius;
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

/// criterion: radius | error << 16.
bool needs(ivec3 centre, uint criterion) {
    const uint radius_code = criterion & 0xffffu, error = criterion >> 16;
    const ivec3 from_eye = centre - eye.xyz;
    // Relative errors are below 2^-20: a few roundings to 24 bits.
    const vec3 d = vec3(from_eye);
    const float squared = d.x * d.x + d.y * d.y + d.z * d.z;
    const float radius = float(decodeRadius(radius_code));
    const float distance = float(reach[error]) + radius, limit = distance * distance;
    const float above = 1.0 + 1.0 / 524288.0;
    if (limit * above < squared) return false;
    float depth = radius;
    for (int i = 0; i < 4; ++i) {
        const vec3 n = vec3(side[i].xyz) * (1.0 / 16384.0);
        depth = min(depth, n.x * d.x + n.y * d.y + n.z * d.z + radius);
    }
    if (limit > squared * above && depth >= distance * (1.0 / 524288.0) + 2.0) return true;
    return needsExactly(from_eye, error, radius_code);
}
bool needsLast(ivec3 centre, uint criterion) {
    return (criterion & kBlocked) != 0u || needs(centre, criterion);
}
