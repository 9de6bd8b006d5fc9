// A sample of a box that nothing drawn so far hides.
layout(early_fragment_tests) in;

flat in uint slot;

void main() {
    now[slot] = 1u;
}
