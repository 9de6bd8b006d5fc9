#include "coarsen/level_items.h"

#include <algorithm>

namespace pietra {

std::vector<LevelItem> itemsOfLevel(const Leaves& leaves, int level,
                                    const std::function<const CellBlob*(CellId)>& below) {
    std::vector<LevelItem> items;
    for (const CellId leaf : leaves.tree->leaves())
        if (cellLevel(leaf) == level)
            if (const auto blob = leaves.blobs.find(leaf); blob != leaves.blobs.end())
                items.push_back({{leaf}, true, blob->second.triangles});
    std::vector<std::pair<uint64_t, CellId>> by_diamond;
    if (level < leaves.tree->deepestLevel())
        for (const CellId cell : leaves.tree->splitCells(level))
            if (below(cellChild(cell, 0)) || below(cellChild(cell, 1)))
                by_diamond.emplace_back(diamondKey(cell), cell);
    std::sort(by_diamond.begin(), by_diamond.end());
    for (size_t i = 0; i < by_diamond.size(); ++i) {
        if (i == 0 || by_diamond[i].first != by_diamond[i - 1].first) items.emplace_back();
        LevelItem& item = items.back();
        item.cells.push_back(by_diamond[i].second);
        for (const int bit : {0, 1})
            if (const CellBlob* child = below(cellChild(by_diamond[i].second, bit)))
                item.triangles += child->triangles / 2;
    }
    std::sort(items.begin(), items.end(),
              [](const LevelItem& a, const LevelItem& b) { return a.path() < b.path(); });
    return items;
}

}  // namespace pietra
