#include "methods/pmesh/collapses.h"

namespace pietra::pmesh {

void CollapseStore::append(std::span<const CollapseLink> links,
                           std::span<const CollapseRecord> records,
                           std::span<const uint32_t> number, std::span<const uint32_t> words) {
    std::vector<CollapseShape> shapes(records.begin(), records.end());
    std::vector<Wings> wings;
    for (const CollapseRecord& r : records) {
        wings.push_back(r.wing);
        for (CollapseWing& w : wings.back())
            if (w.vertex != kNoVertex) w.vertex = number[w.vertex];
    }
    links_.append(std::as_bytes(links));
    shapes_.append(std::as_bytes(std::span(shapes)));
    wings_.append(std::as_bytes(std::span(wings)));
    words_.append(std::as_bytes(words));
    size_ += uint32_t(records.size());
}

void CollapseStore::readWords(uint32_t i, WordLayout layout, std::vector<uint32_t>& words) const {
    const size_t had = words.size();
    words.resize(had + 2 * layout.words());
    const auto to = std::as_writable_bytes(std::span(words).subspan(had));
    words_.read(i * to.size(), to);
}

void CollapseStore::save(StateWriter& state) {
    for (Spill* spill : {&links_, &shapes_, &wings_, &aliases_, &words_}) {
        spill->save();
        state.put(spill->bytes());
    }
    state.put(size_);
}

void CollapseStore::restore(StateReader& state) {
    for (Spill* spill : {&links_, &shapes_, &wings_, &aliases_, &words_})
        spill->restore(state.get<uint64_t>());
    state.get(size_);
}

}  // namespace pietra::pmesh
