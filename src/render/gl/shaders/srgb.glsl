// linearFromSrgb() of shading.h.
vec3 linearFromSrgb(vec3 srgb) {
    vec3 c = clamp(srgb, 0.0, 1.0);
    return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), greaterThan(c, vec3(0.04045)));
}
