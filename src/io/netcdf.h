#pragma once
// Reads gridded data out of netCDF "classic" files (CDF-1 with 32-bit and CDF-2 with 64-bit
// offsets; Unidata, The NetCDF Classic Format Specification): fixed-size variables of numbers.
// Record variables, netCDF-4 (HDF5) and attributes are not read. Faults in the file are InputErrors
// with the byte. Not thread-safe.

#include <cstdint>
#include <string>
#include <vector>

#include "extmem/file.h"

namespace pietra {

class NetcdfFile {
public:
    enum class Type : uint32_t { kByte = 1, kChar, kShort, kInt, kFloat, kDouble };
    struct Dimension {
        std::string name;
        uint64_t length = 0;  ///< 0: the record dimension
    };
    struct Variable {
        std::string name;
        Type type = Type::kByte;
        std::vector<size_t> dimensions;  ///< positions in dimensions(), slowest first
        uint64_t offset = 0;
        uint64_t count = 0;  ///< of values; 0 for record variables
    };

    /// Reads the header.
    explicit NetcdfFile(const std::string& path);

    const std::string& path() const { return file_.path(); }
    const std::vector<Dimension>& dimensions() const { return dimensions_; }
    const std::vector<Variable>& variables() const { return variables_; }
    /// Null where there is none.
    const Variable* find(const std::string& name) const;
    /// Values first, first + 1, ... of a variable of numbers, as doubles.
    void read(const Variable& variable, uint64_t first, size_t count,
              std::vector<double>& out) const;

private:
    void readHeader();
    void skipAttributes();
    uint64_t takeNumber(size_t bytes);
    uint64_t takeCount(uint32_t tag);
    std::string takeName();
    void skip(uint64_t bytes);
    [[noreturn]] void fail(const std::string& what) const;

    File file_;
    uint64_t size_ = 0;
    uint64_t at_ = 0;  ///< while reading the header
    std::vector<Dimension> dimensions_;
    std::vector<Variable> variables_;
};

}  // namespace pietra
