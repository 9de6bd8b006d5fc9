#include "methods/pmesh/collapses.h"

namespace pietra::pmesh {

void CollapseStore::append(std::span<const CollapseLink> links,
                           std::span<const CollapseRecord> records,
                           std::span<const uint32_t> number, std::span<const uint32_t> words) {
    std::vector<CollapseShape> shapes;
    std::vector<uint32_t> rings;
    for (const CollapseRecord& r : records) {
        const uint32_t record = size_ + uint32_t(shapes.size());
        shapes.push_back(r);
        if (!r.closed) continue;
        rings.insert(rings.end(), {record, r.ring_size});
        for (uint8_t k = 0; k < r.ring_size; ++k) rings.push_back(number[r.ring[k]]);
    }
    links_.append(std::as_bytes(links));
    shapes_.append(std::as_bytes(std::span(shapes)));
    rings_.append(std::as_bytes(std::span(rings)));
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
    for (Spill* spill : {&links_, &shapes_, &rings_, &aliases_, &words_}) {
        spill->save();
        state.put(spill->bytes());
    }
    state.put(size_);
}

void CollapseStore::restore(StateReader& state) {
    for (Spill* spill : {&links_, &shapes_, &rings_, &aliases_, &words_})
        spill->restore(state.get<uint64_t>());
    state.get(size_);
}

}  // namespace pietra::pmesh
