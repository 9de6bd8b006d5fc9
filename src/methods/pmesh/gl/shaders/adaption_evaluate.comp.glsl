// Merges of a frame's last pass, if there are splits in it too: ARGUMENT is 1.

void main() {
    if (is_evaluated == 0u) findMerges();
}
