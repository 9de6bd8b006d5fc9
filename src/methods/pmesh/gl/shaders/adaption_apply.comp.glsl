// Adaption::apply(): all splits, or, where there are none, all merges. In a frame's last pass, where
// there may be both, a second step with ARGUMENT 1 does the merges.

void main() {
    const bool has_splits = splits != 0u;
    if (has_splits && argument == 0u) applySplits();
    if (has_splits == (argument == 1u)) applyMerges();  // one call: drivers put it in place
}
