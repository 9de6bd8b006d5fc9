#include "io/packed_source.h"

#include <fmt/format.h>
#include <lzma.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <cstring>
#include <span>
#include <string_view>

#include "base/check.h"
#include "base/error.h"

namespace pietra {

namespace {

constexpr size_t kInputBytes = 1 << 18;
constexpr uint64_t kMaxWindowBytes = uint64_t(128) << 20;

/// One packer's stream, decompressed forwards. Members follow one another without a sign.
class Unpacker {
public:
    enum class Status {
        kGoesOn,
        kEnded,  ///< the data ends here, whatever the file still holds
        kDamaged,
        kNoMemory,
        kTooLarge  ///< needs a window above kMaxWindowBytes
    };
    virtual ~Unpacker() = default;
    virtual void restart() = 0;
    /// Takes from the front of `in` and fills from the front of `out`; moves both on. `in` is empty
    /// only at the end of the file.
    virtual Status step(std::span<const uint8_t>& in, std::span<uint8_t>& out) = 0;
    /// At the end of the file: nothing is missing.
    virtual bool mayEnd() const = 0;
};

class GzipUnpacker : public Unpacker {
public:
    GzipUnpacker() {
        // 15 bits of window, 16 for the gzip wrapper.
        CHECK_EQ(inflateInit2(&stream_, 15 + 16), Z_OK);
    }
    ~GzipUnpacker() override { inflateEnd(&stream_); }
    void restart() override {
        inflateReset(&stream_);
        between_ = false;
    }
    Status step(std::span<const uint8_t>& in, std::span<uint8_t>& out) override {
        if (between_) {
            // Bytes that begin no member are padding, as gzip itself takes them.
            if (in.empty() || in[0] != 0x1f) return Status::kEnded;
            restart();
        }
        stream_.next_in = const_cast<uint8_t*>(in.data());
        stream_.avail_in = uInt(in.size());
        stream_.next_out = out.data();
        stream_.avail_out = uInt(std::min<size_t>(out.size(), 1 << 30));
        const int status = inflate(&stream_, Z_NO_FLUSH);
        in = in.last(stream_.avail_in);
        out = out.subspan(size_t(stream_.next_out - out.data()));
        between_ = status == Z_STREAM_END;
        if (status == Z_MEM_ERROR) return Status::kNoMemory;
        if (status == Z_OK || status == Z_BUF_ERROR || between_) return Status::kGoesOn;
        return Status::kDamaged;
    }
    bool mayEnd() const override { return between_; }

private:
    z_stream stream_{};
    bool between_ = false;  ///< after a member
};

class XzUnpacker : public Unpacker {
public:
    XzUnpacker() { restart(); }
    ~XzUnpacker() override { lzma_end(&stream_); }
    void restart() override {
        ended_ = false;
        CHECK_EQ(int(lzma_stream_decoder(&stream_, kMaxWindowBytes + (uint64_t(1) << 20),
                                         LZMA_CONCATENATED)),
                 int(LZMA_OK));
    }
    Status step(std::span<const uint8_t>& in, std::span<uint8_t>& out) override {
        stream_.next_in = in.data();
        stream_.avail_in = in.size();
        stream_.next_out = out.data();
        stream_.avail_out = out.size();
        const lzma_ret status = lzma_code(&stream_, in.empty() ? LZMA_FINISH : LZMA_RUN);
        in = in.last(stream_.avail_in);
        out = out.last(stream_.avail_out);
        ended_ = status == LZMA_STREAM_END;
        switch (status) {
            case LZMA_OK:
            case LZMA_BUF_ERROR:  // no more input
                return Status::kGoesOn;
            case LZMA_STREAM_END:
                return Status::kEnded;
            case LZMA_MEM_ERROR:
                return Status::kNoMemory;
            case LZMA_MEMLIMIT_ERROR:
                return Status::kTooLarge;
            default:
                return Status::kDamaged;
        }
    }
    bool mayEnd() const override { return ended_; }

private:
    lzma_stream stream_ = LZMA_STREAM_INIT;
    bool ended_ = false;
};

class ZstdUnpacker : public Unpacker {
public:
    ZstdUnpacker() : stream_(ZSTD_createDStream()) {
        if (!stream_) throw MemoryError("no memory to decompress");
        ZSTD_DCtx_setParameter(stream_, ZSTD_d_windowLogMax, 27);
    }
    ~ZstdUnpacker() override { ZSTD_freeDStream(stream_); }
    void restart() override {
        ZSTD_DCtx_reset(stream_, ZSTD_reset_session_only);
        between_ = true;
    }
    Status step(std::span<const uint8_t>& in, std::span<uint8_t>& out) override {
        if (between_ && in.empty()) return Status::kEnded;
        ZSTD_inBuffer input{in.data(), in.size(), 0};
        ZSTD_outBuffer output{out.data(), out.size(), 0};
        const size_t status = ZSTD_decompressStream(stream_, &output, &input);
        in = in.subspan(input.pos);
        out = out.subspan(output.pos);
        if (!ZSTD_isError(status)) {
            between_ = status == 0;
            return Status::kGoesOn;
        }
        const std::string_view fault = ZSTD_getErrorName(status);
        if (fault.starts_with("Frame requires too much memory")) return Status::kTooLarge;
        return fault.starts_with("Allocation error") ? Status::kNoMemory : Status::kDamaged;
    }
    bool mayEnd() const override { return between_; }

private:
    ZSTD_DStream* stream_;
    bool between_ = true;  ///< before or after a frame
};

template <class T>
std::unique_ptr<Unpacker> make() {
    return std::make_unique<T>();
}

struct Packer {
    const char* name;
    uint64_t largest_ratio;  ///< plain bytes are at most this many a packed one
    std::unique_ptr<Unpacker> (*unpacker)();
};
/// gzip: 258 bytes a match of two bits. xz: a match of 273 bytes is 14 decisions of at least
/// log2(2048 / 2017) bits each. zstd: a block of 128 KiB takes four bytes or more.
constexpr Packer kGzip{"gzip", 1032, make<GzipUnpacker>};
constexpr Packer kXz{"xz", 8192, make<XzUnpacker>};
constexpr Packer kZstd{"zstd", 32768, make<ZstdUnpacker>};

class PackedSource : public ByteSource {
public:
    PackedSource(const InputFile& file, const Packer& packer) : packer_(packer), file_(file) {}
    const std::string& path() const override { return file_.path(); }
    size_t read(uint64_t offset, void* data, size_t bytes) override {
        if (!unpacker_) {
            buffer_.resize(kInputBytes);
            unpacker_ = packer_.unpacker();
        }
        if (offset < position_) restart();
        skipTo(offset);
        return offset == position_ ? unpack({static_cast<uint8_t*>(data), bytes}) : 0;
    }
    uint64_t lengthBound() const override {
        const uint64_t ratio = packer_.largest_ratio;
        return file_.size() > UINT64_MAX / ratio ? UINT64_MAX : file_.size() * ratio;
    }
    const std::string& tempDir() const override { return file_.tempDir(); }
    uint64_t storedBytes() const override { return file_.size(); }
    bool isCompressed() const override { return true; }
    void release() override {
        unpacker_.reset();
        std::vector<uint8_t>().swap(buffer_);
        forgetPlace();
        file_.release();
    }
    std::unique_ptr<ByteSource> again() const override {
        return std::make_unique<PackedSource>(file_, packer_);
    }
    std::unique_ptr<ByteSource> unpacked() override {
        uint64_t offset = 0;
        InputFile plain = file_.copied([&](std::span<uint8_t> block) {
            const size_t n = read(offset, block.data(), block.size());
            offset += n;
            return n;
        });
        return openPlain(std::move(plain), file_.size());
    }

private:
    void restart() {
        unpacker_->restart();
        forgetPlace();
    }
    void forgetPlace() {
        input_ = {};
        input_end_ = position_ = 0;
        ended_ = false;
    }

    void skipTo(uint64_t offset) {
        std::vector<uint8_t> dropped(std::min<uint64_t>(offset - position_, kInputBytes));
        while (position_ < offset) {
            const size_t n = size_t(std::min<uint64_t>(offset - position_, dropped.size()));
            if (unpack({dropped.data(), n}) < n) return;
        }
    }

    void fillInput() {
        if (!input_.empty()) return;
        const size_t n = file_.read(input_end_, buffer_.data(), buffer_.size());
        input_ = {buffer_.data(), n};
        input_end_ += n;
    }

    /// Fills `out`, but at the end; returns how many bytes there were.
    size_t unpack(std::span<uint8_t> out) {
        const size_t wanted = out.size();
        while (!out.empty() && !ended_) {
            fillInput();
            const size_t before = out.size();
            const bool no_input = input_.empty();
            const Unpacker::Status status = unpacker_->step(input_, out);
            if (status == Unpacker::Status::kEnded) {
                ended_ = true;
            } else if (status != Unpacker::Status::kGoesOn) {
                failUnpacking(status);
            } else if (no_input && out.size() == before) {
                if (!unpacker_->mayEnd())
                    throw InputError::atByte(path(), input_end_,
                                             fmt::format("the {} data ends early", packer_.name));
                ended_ = true;
            }
        }
        position_ += wanted - out.size();
        return wanted - out.size();
    }

    [[noreturn]] void failUnpacking(Unpacker::Status status) const {
        if (status == Unpacker::Status::kNoMemory)
            throw MemoryError("no memory to decompress " + path());
        const char* const what = status == Unpacker::Status::kTooLarge
                                     ? "needs more than 128 MiB of memory: unpack it first"
                                     : "is damaged";
        throw InputError::atByte(path(), input_end_ - input_.size(),
                                 fmt::format("the {} data {}", packer_.name, what));
    }

    const Packer& packer_;
    InputFile file_;
    std::unique_ptr<Unpacker> unpacker_;
    std::vector<uint8_t> buffer_;
    std::span<const uint8_t> input_;  ///< packed bytes that the unpacker has not seen
    uint64_t input_end_ = 0;          ///< packed bytes read from the file
    uint64_t position_ = 0;           ///< plain bytes delivered
    bool ended_ = false;
};

}  // namespace

std::unique_ptr<ByteSource> openPacked(InputFile& file) {
    using namespace std::string_view_literals;
    char bytes[6] = {};
    const std::string_view magic(bytes, file.read(0, bytes, sizeof bytes));
    const Packer* packer = nullptr;
    if (magic.starts_with("\x1f\x8b"sv)) packer = &kGzip;
    if (magic.starts_with("\xfd\x37zXZ\0"sv)) packer = &kXz;
    // A frame, or one that zstd skips, as parallel packers put them first.
    const bool skipped = magic.size() > 3 && (magic[0] & 0xf0) == 0x50 &&
                         magic.substr(1).starts_with("\x2a\x4d\x18"sv);
    if (magic.starts_with("\x28\xb5\x2f\xfd"sv) || skipped) packer = &kZstd;
    if (!packer) return nullptr;
    return std::make_unique<PackedSource>(file, *packer);
}

}  // namespace pietra
