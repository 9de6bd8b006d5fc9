#pragma once
// Reads a Wavefront OBJ file statement by statement, and words its faults.
//
// A statement is a line, or several where all but the last end with a backslash; comments ('#'
// first on a line) never go on. Lines end with LF, CRLF or CR (one of these a file). Neither
// statements nor faces have a longest length: nothing is held but the reader's window. Numbers and
// words of more than kMaxWord characters are faults. Every fault is an InputError with its line.
//
// Whatever reads a file makes the same cuts between statements, whether it takes a statement apart
// or skips it: places found by one pass are good for the next.

#include <cstdint>
#include <cstring>
#include <string>

#include "io/number_parser.h"
#include "io/text_window.h"

namespace pietra {

/// A place in an OBJ file; lines count from 1.
struct ObjPlace {
    uint64_t offset = 0;
    uint64_t line = 1;
};

/// What a statement is, by its first word.
enum class ObjWord : uint8_t {
    kVertex,    ///< v
    kNormal,    ///< vn
    kTexture,   ///< vt
    kFace,      ///< f, fo
    kLine,      ///< l
    kPoint,     ///< p
    kMaterial,  ///< usemtl, mtllib and what else says how a surface looks
    kFreeForm,  ///< curves and surfaces
    kPaint,     ///< "#MRGB": ZBrush's colours, in comments
    kGroup,     ///< groups, names, smoothing, display attributes: nothing that is shown
    kUnknown
};

/// A corner of a face as it stands there: 1, 2, ... from the start or -1, -2, ... from the end of
/// what came before; 0 is none.
struct ObjCorner {
    int64_t vertex = 0;
    int64_t texture = 0;
    int64_t normal = 0;
};

class ObjCursor : private TextWindow {
public:
    explicit ObjCursor(ByteReader& reader) : TextWindow(reader) {}

    /// The first statement; also finds out how lines end.
    ObjPlace start();

    using TextWindow::offset;
    ObjPlace place() const { return {offset(), line_}; }
    void seek(const ObjPlace& place) {
        TextWindow::seek(place.offset);
        line_ = place.line;
    }

    /// Moves to the next statement and over its first word, but for one that is kUnknown. False at
    /// the end of the file.
    bool nextStatement(ObjWord& word);
    /// Moves past the statement.
    void skipStatement();
    /// The word at the cursor, for messages.
    std::string wordHere() const { return shownWord(p_); }
    /// How many words follow in the statement; stays where it is. Fast, so what joins lines and
    /// comments within are counted too, and of a statement of over 1 MiB only the beginning is.
    size_t countWords();

    /// Moves to the next word of the statement; false where there is none.
    bool more() {
        for (;; ++p_) {
            need();
            const char c = *p_;
            if (static_cast<unsigned char>(c) > ' ') {
                if (c == '#') return false;
                if (c != '\\' || !joinsLines(p_)) return true;
                p_ += p_[1] == line_end_ ? 1 : 2;
                ++line_;
            } else if (c == line_end_) {
                return false;
            } else if (c == '\0') {
                return p_ != end_;  // a byte of the file that is no text, if not its end
            }
        }
    }
    /// The word at the cursor as a number; more() was true. `what` is said to be no number.
    double takeReal(const char* what) {
        double value = 0;
        const char* const end = parseReal(p_, end_, value);
        if (!end || !endsWord(end) || end - p_ > ptrdiff_t(kMaxWord)) [[unlikely]]
            failWord(std::string("is no number (") + what + ")");
        p_ = end;
        return value;
    }
    /// The word at the cursor as a corner of a face, whose vertex is not 0; more() was true.
    ObjCorner takeCorner();
    /// Moves past the statement, which must have no more words.
    void endStatement(const char* what) {
        if (more()) [[unlikely]]
            failWord(std::string("stands after ") + what);
        skipStatement();
    }

    [[noreturn]] void fail(const std::string& what) const;
    /// "WORD" followed by `what`.
    [[noreturn]] void failWord(const std::string& what) const;

private:
    void skipComment();
    /// At `p` is a backslash at the end of a line.
    bool joinsLines(const char* p) const {
        return *p == '\\' && (p[1] == line_end_ || (p[1] == '\r' && p[2] == line_end_));
    }
    bool endsWord(const char* p) const {
        const auto c = static_cast<unsigned char>(*p);
        if (c > ' ') return c == '#' || joinsLines(p);
        return c != 0 || (p == end_ && at_end_);
    }
    ObjWord takeWord();
    ObjWord takeLongWord();

    char line_end_ = '\n';
    uint64_t line_ = 1;
};

inline void ObjCursor::skipStatement() {
    for (;;) {
        const auto* const end =
            static_cast<const char*>(std::memchr(p_, line_end_, size_t(end_ - p_)));
        if (end) [[likely]] {
            const char* last = end;
            if (last > p_ && last[-1] == '\r') --last;
            const bool goes_on = last > p_ && last[-1] == '\\';
            p_ = end + 1;
            ++line_;
            if (!goes_on) return;
        } else if (at_end_) {
            p_ = end_;
            return;
        } else {
            // note: a backslash must stay in sight of the line end after it.
            if (end_ - p_ > 2) p_ = end_ - 2;
            refill();
        }
    }
}

inline bool ObjCursor::nextStatement(ObjWord& word) {
    for (;;) {
        need();
        const char c = *p_;
        if (static_cast<unsigned char>(c) > ' ') {
            if (c == '#') {
                if (std::memcmp(p_, "#MRGB", 5) == 0) return word = ObjWord::kPaint, true;
                skipComment();
                continue;
            }
            if (joinsLines(p_)) {
                ++p_;
                continue;
            }
            word = takeWord();
            return true;
        }
        if (c == '\0' && p_ == end_) return false;
        if (c == line_end_) ++line_;
        ++p_;
    }
}

}  // namespace pietra
