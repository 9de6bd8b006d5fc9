#include "runtime/page_pool.h"

#include <fmt/format.h>

#include <utility>

#include "base/error.h"
#include "base/text.h"
#include "runtime/patch_reader.h"

namespace pietra {
namespace {

/// A frame copies no more to the sink, but for one page; as decoded.
constexpr size_t kUploadBytes = size_t(4) << 20;

/// Of each page in memory, with what its meshes are held by.
std::vector<size_t> copyBytes(const ModelReader& model) {
    std::vector<size_t> bytes = decodedPageBytes(model);
    for (const Node& node : model.nodes()) bytes[node.page] += sizeof(Mesh);
    return bytes;
}

std::vector<PageIndex> rootPages(const Forest& forest) {
    std::vector<PageIndex> pages;
    for (const NodeIndex root : forest.roots()) pages.push_back(forest.node(root).page);
    std::sort(pages.begin(), pages.end());
    pages.erase(std::unique(pages.begin(), pages.end()), pages.end());
    return pages;
}

}  // namespace

SceneModel::SceneModel(const ModelReader& r)
    : reader(r),
      forest(r.nodes()),
      residency(forest, r.pageCount()),
      refiner(residency),
      closed_parts(closedPartsWithin(r.info(), r.nodes())),
      copy_bytes(copyBytes(r)),
      drawn_bytes(copy_bytes),
      copies(r.pageCount()),
      last_used(r.pageCount(), 0),
      eye_used(r.pageCount(), 0),
      last_wanted(r.pageCount(), 0),
      arriving(r.pageCount(), 0),
      bad(r.pageCount(), 0) {}

PagePool::PagePool(SceneModels& models, size_t ram_bytes, size_t table_bytes, int loader_threads,
                   PageSink* sink)
    : models_(models),
      sink_(sink),
      ram_(ram_bytes - std::min(ram_bytes, table_bytes)),
      device_(sink != nullptr ? sink->capacityBytes() : 0) {
    loadRoots(table_bytes);
    std::vector<PageSource> sources;
    for (const auto& model : models) sources.push_back({&model->reader});
    loader_ = std::make_unique<PageLoader>(std::move(sources), models.empty() ? 0 : loader_threads);
}

PagePool::~PagePool() {
    if (sink_ == nullptr) return;
    for (uint32_t m = 0; m < models_.size(); ++m)
        for (PageIndex page = 0; page < models_[m]->bad.size(); ++page)
            if (models_[m]->residency.resident(page)) sink_->release({m, page});
}

void PagePool::loadRoots(size_t table_bytes) {
    size_t needed = 0;
    for (const auto& model : models_)
        for (const PageIndex page : rootPages(model->forest)) needed += model->copy_bytes[page];
    if (needed > ram_.budget)
        throw MemoryError(fmt::format("the tables and the coarsest level need {}",
                                      formatBytes(table_bytes + needed)));
    for (uint32_t m = 0; m < models_.size(); ++m)
        for (const PageIndex page : rootPages(models_[m]->forest)) {
            models_[m]->reader.decode(page, models_[m]->copies[page]);
            ram_.used += models_[m]->copy_bytes[page];
            if (!enter({m, page}))
                throw MemoryError(fmt::format("the coarsest level needs {} of graphics memory",
                                              formatBytes(needed)));
        }
}

void PagePool::publish(uint32_t frame) {
    frame_ = frame;
    wanted_.clear();
    ram_.beginFrame();
    device_.beginFrame();
    loader_->take(loaded_);
    for (LoadedPage& page : loaded_) keep(page);
    loaded_.clear();
    const size_t scattered_before = scattered_bytes_;
    size_t upload_left = kUploadBytes;
    std::erase_if(arriving_, [&](const PageKey& key) {
        if (!tryArrive(key, upload_left)) return false;
        modelOf(key).arriving[key.page] = 0;
        return true;
    });
    if (scattered_bytes_ == scattered_before) scattered_bytes_ = 0;
}

void PagePool::keep(LoadedPage& page) {
    SceneModel& model = modelOf(page.key);
    ram_.reserved -= model.copy_bytes[page.key.page];
    if (!page.fault.empty()) {
        model.bad[page.key.page] = 1;
        model.residency.lose(page.key.page);
        faults_.push_back(fmt::format("{}: byte {}: {}", model.reader.path(),
                                      model.reader.page(page.key.page).offset, page.fault));
        return;
    }
    model.copies[page.key.page] = std::move(page.patches);
    ram_.used += model.copy_bytes[page.key.page];
    if (model.residency.resident(page.key.page)) return;  // only its copy was missing
    model.arriving[page.key.page] = 1;
    arriving_.push_back(page.key);
}

bool PagePool::tryArrive(const PageKey& key, size_t& upload_left) {
    const SceneModel& model = modelOf(key);
    if (sink_ == nullptr) return enter(key);
    const size_t bytes = model.copy_bytes[key.page];
    if (bytes > upload_left && upload_left < kUploadBytes) return false;
    if (!sink_->mayUpload(bytes)) return false;
    if (!enter(key)) {
        scattered_bytes_ += bytes;
        return false;
    }
    upload_left -= std::min(bytes, upload_left);
    return true;
}

/// Makes resident what has a copy. False where there is no room for it, now.
bool PagePool::enter(const PageKey& key) {
    SceneModel& model = modelOf(key);
    if (sink_ != nullptr) {
        const size_t before = sink_->usedBytes();
        if (!sink_->upload(key, model.copies[key.page])) return false;
        device_.used = sink_->usedBytes();
        model.drawn_bytes[key.page] = device_.used - before;
    }
    model.residency.arrive(key.page);
    model.last_used[key.page] = frame_;
    return true;
}

void PagePool::want(PageKey key, Need need) {
    SceneModel& model = modelOf(key);
    if (model.last_wanted[key.page] == frame_ || model.bad[key.page] != 0) return;
    model.last_wanted[key.page] = frame_;
    wanted_.push_back({key, need});
}

void PagePool::load() {
    std::vector<PageKey> to_load;
    missing_ = 0;
    blocked_ = false;
    const auto begun = loader_->forget();
    if (!begun) {
        for (const Wanted& wanted : wanted_) missing_ += wanted.need != Need::kLater;
        return;
    }
    forgetUnwanted();
    reserve(*begun);
    short_of_ram_ = false;
    blocked_ = scattered_bytes_ > 0 && !makeRoomToDraw(scattered_bytes_, Need::kDraw);
    for (const Wanted& wanted : wanted_) {
        missing_ += wanted.need != Need::kLater;
        if (modelOf(wanted.key).arriving[wanted.key.page] != 0 ||
            std::find(begun->begin(), begun->end(), wanted.key) != begun->end())
            continue;
        if (blocked_ || !provide(wanted, to_load)) break;
    }
    loader_->want(to_load, dropped_);
}

/// What could not arrive while it was wanted.
void PagePool::forgetUnwanted() {
    std::erase_if(arriving_, [&](const PageKey& key) {
        SceneModel& model = modelOf(key);
        if (model.last_wanted[key.page] == frame_) return false;
        model.arriving[key.page] = 0;
        if (sink_ == nullptr) dropCopy(key);
        return true;
    });
}

void PagePool::reserve(std::span<const PageKey> begun) {
    ram_.reserved = device_.reserved = 0;
    for (const PageKey& key : begun) {
        ram_.reserved += modelOf(key).copy_bytes[key.page];
        if (!modelOf(key).residency.resident(key.page))
            device_.reserved += modelOf(key).drawn_bytes[key.page];
    }
    if (sink_ != nullptr) device_.used = sink_->usedBytes();
    for (const PageKey& key : arriving_) device_.reserved += modelOf(key).drawn_bytes[key.page];
}

/// Makes room for the page and sends for it. False where there is none.
bool PagePool::provide(const Wanted& wanted, std::vector<PageKey>& to_load) {
    const PageKey key = wanted.key;
    SceneModel& model = modelOf(key);
    const bool to_device = sink_ != nullptr && !model.residency.resident(key.page);
    const bool copied = model.hasCopy(key.page);
    const size_t kept_free = wanted.need == Need::kLater ? needed_elsewhere_ : 0;
    if (!copied && !makeRoomInRam(model.copy_bytes[key.page] + kept_free, wanted.need)) {
        // Copies that are on their way to the sink will make room.
        const bool for_ever = sink_ == nullptr || (ram_.reserved == 0 && arriving_.empty());
        blocked_ = short_of_ram_ = wanted.need == Need::kDraw && for_ever;
        missing_ -= wanted.need == Need::kEye && for_ever;
        return wanted.need == Need::kEye;
    }
    if (to_device) {
        if (!makeRoomToDraw(model.drawn_bytes[key.page], wanted.need)) {
            blocked_ = wanted.need == Need::kDraw;
            missing_ -= wanted.need == Need::kEye;
            return wanted.need == Need::kEye;
        }
        device_.reserved += model.drawn_bytes[key.page];
    }
    if (copied) {
        model.arriving[key.page] = 1;
        arriving_.push_back(key);
    } else {
        ram_.reserved += model.copy_bytes[key.page];
        to_load.push_back(key);
    }
    return true;
}

size_t PagePool::release(size_t bytes) {
    const size_t before = ram_.used;
    const size_t more = ram_.free() + bytes;
    (void)(sink_ != nullptr ? makeRoomInRam(more, Need::kDraw) : makeRoomToDraw(more, Need::kDraw));
    return before - ram_.used;
}

size_t PagePool::releaseDevice(size_t bytes) {
    if (sink_ == nullptr) return 0;
    const size_t before = device_.used = sink_->usedBytes();
    (void)makeRoomToDraw(device_.free() + bytes, Need::kDraw);
    return before - device_.used;
}

bool PagePool::makeRoomInRam(size_t bytes, Need need) {
    if (sink_ == nullptr) return makeRoomToDraw(bytes, need);
    return ram_.makeRoom(
        bytes, need, frame_, [&] { return copiesToDrop(); },
        [&](const PageKey& key) { dropCopy(key); });
}

bool PagePool::makeRoomToDraw(size_t bytes, Need need) {
    return (sink_ != nullptr ? device_ : ram_)
        .makeRoom(
            bytes, need, frame_, [&] { return pagesToLeave(); },
            [&](const PageKey& key) { leave(key); });
}

/// All but those that tell where the eye is: if these left for what is drawn, the eye would count
/// as inside, more would be drawn, and so on for ever.
std::vector<PageMemory::Victim> PagePool::copiesToDrop() const {
    std::vector<PageMemory::Victim> victims;
    for (uint32_t m = 0; m < models_.size(); ++m)
        for (PageIndex page = 0; page < models_[m]->bad.size(); ++page) {
            const SceneModel& model = *models_[m];
            if (!model.hasCopy(page) || model.eye_used[page] == frame_) continue;
            const uint32_t latest = frame_ - PageMemory::kFramesKept;
            victims.push_back({{m, page}, std::min(model.last_used[page], latest)});
        }
    return victims;
}

std::vector<PageMemory::Victim> PagePool::pagesToLeave() const {
    std::vector<PageMemory::Victim> victims;
    for (uint32_t m = 0; m < models_.size(); ++m)
        for (PageIndex page = 0; page < models_[m]->bad.size(); ++page)
            if (models_[m]->residency.resident(page) && !models_[m]->usedIn(frame_, page))
                victims.push_back({{m, page}, models_[m]->last_used[page]});
    return victims;
}

void PagePool::leave(const PageKey& key) {
    modelOf(key).residency.leave(key.page);
    if (sink_ == nullptr) return dropCopy(key);
    sink_->release(key);
    device_.used = sink_->usedBytes();
}

void PagePool::dropCopy(const PageKey& key) {
    SceneModel& model = modelOf(key);
    if (model.arriving[key.page] != 0) return;
    dropped_.push_back({key, std::exchange(model.copies[key.page], {}), {}, {}});
    ram_.used -= model.copy_bytes[key.page];
}

}  // namespace pietra
