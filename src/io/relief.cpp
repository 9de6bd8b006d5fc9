#include "io/relief.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "io/colour_scale.h"
#include "io/netcdf.h"
#include "io/noise.h"

namespace pietra {

namespace {

constexpr ColourStep kSea[] = {
    {-9000, 6, 14, 46},   {-6000, 12, 34, 88},  {-4000, 20, 58, 122},
    {-2000, 34, 92, 156}, {-200, 74, 142, 190}, {0, 132, 190, 214},
};
constexpr ColourStep kLand[] = {
    {0, 74, 122, 66},     {250, 106, 144, 76},  {700, 164, 160, 96},   {1400, 170, 138, 84},
    {2600, 134, 100, 68}, {4000, 122, 104, 92}, {6000, 150, 140, 134},
};
constexpr Rgba8 kSnow{244, 246, 250, 255};

/// Mean height of lasting snow: high at the equator, at the sea around 70 degrees.
double snowLine(double sine_of_latitude) {
    const double t = sine_of_latitude / 0.94;
    return 5600 * (1 - t * t);
}

Rgba8 reliefColour(double height_m, double sine_of_latitude) {
    if (height_m <= 0) return colourAt(kSea, height_m);
    const double depth = height_m - snowLine(sine_of_latitude);
    return blendColours(colourAt(kLand, height_m), kSnow, std::clamp(depth / 400 + 0.5, 0.0, 1.0));
}

/// A grid of heights: row 0 is the south pole, the last row the north pole; columns go eastward.
struct HeightGrid {
    uint64_t bands = 0;  ///< rows less one
    uint64_t columns = 0;
    std::vector<float> height_m;
};

const NetcdfFile::Variable& findHeights(const NetcdfFile& file) {
    const NetcdfFile::Variable* best = nullptr;
    for (const auto& v : file.variables())
        if (v.dimensions.size() == 2 && v.type != NetcdfFile::Type::kChar &&
            (!best || v.count > best->count))
            best = &v;
    if (!best || best->count == 0)
        throw InputError(file.path(), "", "has no grid of numbers over two dimensions");
    return *best;
}

/// The values of the coordinate variable that bears the name of a dimension.
std::vector<double> coordinates(const NetcdfFile& file, size_t dimension) {
    const auto& d = file.dimensions()[dimension];
    const NetcdfFile::Variable* v = file.find(d.name);
    if (!v || v->count != d.length || v->type == NetcdfFile::Type::kChar)
        throw InputError(file.path(), "", fmt::format("has no coordinates for {}", d.name));
    std::vector<double> values;
    file.read(*v, 0, size_t(v->count), values);
    return values;
}

HeightGrid readHeights(const std::string& path) {
    const NetcdfFile file(path);
    const NetcdfFile::Variable& heights = findHeights(file);
    const auto latitude = coordinates(file, heights.dimensions[0]);
    const auto longitude = coordinates(file, heights.dimensions[1]);
    const size_t rows = latitude.size(), columns = longitude.size();
    const double step = 360 / double(columns);
    const bool whole = rows >= 3 && columns >= 3 && std::abs(latitude.front()) > 90 - step / 4 &&
                       std::abs(latitude.front() + latitude.back()) < step / 4 &&
                       std::abs(longitude.back() - longitude.front() - (360 - step)) < step / 4;
    if (!whole)
        throw InputError(
            path, "",
            fmt::format("grid {} does not cover the whole globe, pole to pole", heights.name));
    HeightGrid grid{rows - 1, columns, {}};
    grid.height_m.resize(rows * columns);
    std::vector<double> row;
    for (size_t j = 0; j < rows; ++j) {
        const size_t from_south = latitude.front() < 0 ? j : rows - 1 - j;
        file.read(heights, j * columns, columns, row);
        for (size_t i = 0; i < columns; ++i) {
            if (!(std::abs(row[i]) < 1e5))
                throw InputError(
                    path, "", fmt::format("the height in row {}, column {} is {}", j, i, row[i]));
            grid.height_m[from_south * columns + i] = float(row[i]);
        }
    }
    return grid;
}

class Relief : public SyntheticMesh {
public:
    Relief(const std::string& path, const ReliefSettings& settings)
        : settings_(settings), grid_(readHeights(path)) {
        schema_.colours = true;
        schema_.scalars = {"height_m"};
        chooseStep(settings.triangles);
    }
    const AttributeSchema& schema() const override { return schema_; }
    uint64_t vertexCount() const override { return (bands_ - 1) * columns_ + 2; }
    uint64_t triangleCount() const override { return trianglesFor(step_); }

    /// The south pole, the rows northward, the north pole.
    void makeVertices(uint64_t first, size_t at, size_t count, VertexBatch& batch) const override {
        for (size_t i = 0; i < count; ++i) {
            const uint64_t v = first + i;
            uint64_t row = 0, column = 0;
            if (v == vertexCount() - 1) {
                row = bands_;
            } else if (v > 0) {
                row = 1 + (v - 1) / columns_;
                column = (v - 1) % columns_;
            }
            const double height_m = grid_.height_m[row * step_ * grid_.columns + column * step_];
            const Vec3d direction = directionOf(row, column);
            const double radius = settings_.radius_km + settings_.exaggeration * height_m / 1000;
            batch.position[at + i] = radius * direction;
            batch.colour[at + i] = reliefColour(height_m, direction.z);
            batch.scalar[at + i] = float(height_m);
        }
    }

    void makeTriangles(uint64_t first, std::span<std::array<uint64_t, 3>> out) const override {
        const uint64_t north = vertexCount() - 1, last_cap = triangleCount() - columns_;
        for (auto& triangle : out) {
            const uint64_t t = first++;
            const auto at = [&](uint64_t row, uint64_t column) {
                return 1 + (row - 1) * columns_ + column % columns_;
            };
            if (t < columns_) {
                triangle = {0, at(1, t + 1), at(1, t)};
            } else if (t >= last_cap) {
                triangle = {north, at(bands_ - 1, t - last_cap), at(bands_ - 1, t - last_cap + 1)};
            } else {
                const uint64_t cell = (t - columns_) / 2;
                const uint64_t row = 1 + cell / columns_, column = cell % columns_;
                const uint64_t a = at(row, column), b = at(row, column + 1),
                               c = at(row + 1, column), d = at(row + 1, column + 1);
                // The diagonal alternates, so that no direction is favoured.
                const bool falling = (row + column) % 2 == 0, lower = (t - columns_) % 2 == 0;
                if (falling)
                    triangle = lower ? std::array{a, b, c} : std::array{b, d, c};
                else
                    triangle = lower ? std::array{a, b, d} : std::array{a, d, c};
            }
        }
    }

private:
    uint64_t trianglesFor(uint64_t step) const {
        return 2 * (grid_.columns / step) * (grid_.bands / step - 1);
    }

    void chooseStep(uint64_t wanted) {
        step_ = 1;
        const auto distance = [&](uint64_t step) {
            const double ratio = double(trianglesFor(step)) / double(wanted);
            return std::max(ratio, 1 / ratio);
        };
        for (uint64_t s = 2; wanted > 0 && s <= grid_.bands / 2 && s <= grid_.columns / 3; ++s)
            if (grid_.bands % s == 0 && grid_.columns % s == 0 && distance(s) < distance(step_))
                step_ = s;
        bands_ = grid_.bands / step_;
        columns_ = grid_.columns / step_;
    }

    Vec3d directionOf(uint64_t row, uint64_t column) const {
        const bool south = 2 * row < bands_;
        const SinCos up = quarterTurn(2 * double(south ? row : bands_ - row) / double(bands_));
        const double z = south ? -up.cos : up.cos;
        if (row == 0 || row == bands_) return {0, 0, z};
        const uint64_t quarters = 4 * column / columns_;
        const SinCos east =
            quarterTurn(double(4 * column - quarters * columns_) / double(columns_));
        const double x = up.sin * east.cos, y = up.sin * east.sin;
        switch (quarters) {
            case 0:
                return {x, y, z};
            case 1:
                return {-y, x, z};
            case 2:
                return {-x, -y, z};
            default:
                return {y, -x, z};
        }
    }

    ReliefSettings settings_;
    HeightGrid grid_;
    uint64_t step_ = 1;
    uint64_t bands_ = 0;
    uint64_t columns_ = 0;
    AttributeSchema schema_;
};

}  // namespace

std::unique_ptr<const SyntheticMesh> makeRelief(const std::string& path,
                                                const ReliefSettings& settings) {
    return std::make_unique<Relief>(path, settings);
}

}  // namespace pietra
