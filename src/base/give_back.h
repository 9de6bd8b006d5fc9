#pragma once
// Memory behind what is used of an array: given back to the system, it stays the array's, and costs
// nothing until it is touched again.

#include <cstddef>
#include <vector>

namespace pietra {

/// Whole pages of [begin, end), whose contents are lost.
void giveBack(void* begin, void* end);

/// Of what there is room for behind the last element.
template <class T>
void giveBackBehind(std::vector<T>& elements) {
    giveBack(elements.data() + elements.size(), elements.data() + elements.capacity());
}

}  // namespace pietra
