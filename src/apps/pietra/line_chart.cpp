#include "apps/pietra/line_chart.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace pietra {
namespace {

constexpr double kWidth = 900, kHeight = 230;
constexpr double kLeft = 64, kRight = 14, kTop = 34, kBottom = 28;
constexpr int kSteps = 5;  // of the grid, about

/// 1, 2 or 5 times a power of ten.
double niceStep(double range) {
    const double rough = range / kSteps, power = std::pow(10, std::floor(std::log10(rough)));
    for (const double factor : {1, 2, 5})
        if (rough <= factor * power) return factor * power;
    return 10 * power;
}

/// From values to the plane of the picture.
struct Axes {
    double right = 1, top = 1;

    explicit Axes(const LineChart& chart) : top(chart.least_top) {
        for (const ChartLine& line : chart.lines) {
            if (!line.x.empty()) right = std::max(right, line.x.back());
            for (const double y : line.y)
                if (std::isfinite(y)) top = std::max(top, y);
        }
        top = std::min(top, chart.most_top);
        if (top <= 0) top = 1;
        top = std::ceil(top / niceStep(top) - 1e-9) * niceStep(top);
    }
    double px(double x) const { return kLeft + x / right * (kWidth - kLeft - kRight); }
    double py(double y) const {
        return kHeight - kBottom - std::min(y, top) / top * (kHeight - kTop - kBottom);
    }
};

void appendGrid(std::string& svg, const Axes& axes) {
    const auto text = [&](double x, double y, const char* anchor, double value) {
        svg += fmt::format("<text class=label x={:.1f} y={:.1f} text-anchor={}>{:.6g}</text>\n", x,
                           y, anchor, value);
    };
    const double dy = niceStep(axes.top), dx = niceStep(axes.right);
    for (int i = 0; i * dy <= axes.top * 1.0001; ++i) {
        svg += fmt::format("<path class=grid d='M{} {:.1f}H{}'/>\n", kLeft, axes.py(i * dy),
                           kWidth - kRight);
        text(kLeft - 7, axes.py(i * dy) + 4, "end", i * dy);
    }
    for (int i = 0; i * dx <= axes.right * 1.0001; ++i)
        text(axes.px(i * dx), kHeight - kBottom + 17, "middle", i * dx);
    svg += fmt::format("<text class=label x={} y={} text-anchor=end>seconds</text>\n",
                       kWidth - kRight, kHeight - 1);
}

std::string pathOf(const ChartLine& line, const Axes& axes) {
    std::string path;
    bool pen_down = false;
    for (size_t i = 0; i < line.x.size(); ++i) {
        if (std::isfinite(line.y[i]))
            path += fmt::format("{}{:.1f} {:.1f}", pen_down ? "L" : "M", axes.px(line.x[i]),
                                axes.py(line.y[i]));
        pen_down = std::isfinite(line.y[i]);
    }
    return path;
}

}  // namespace

std::string lineChartSvg(const LineChart& chart) {
    const Axes axes(chart);
    std::string svg = fmt::format("<svg viewBox='0 0 {} {}' role=img>\n", kWidth, kHeight);
    svg += fmt::format("<text class=title x=0 y=16>{}</text>\n",
                       escapedHtml(chart.title + (chart.unit.empty() ? "" : ", " + chart.unit)));
    appendGrid(svg, axes);
    for (size_t i = chart.lines.size(); i-- > 0;)
        svg += fmt::format("<path class='line s{}' d='{}'/>\n", i, pathOf(chart.lines[i], axes));
    double x = kWidth - kRight;
    for (size_t i = chart.lines.size(); i-- > 0 && chart.lines.size() > 1;) {
        const std::string& name = chart.lines[i].name;
        svg += fmt::format("<text class=label x={:.1f} y=16 text-anchor=end>{}</text>\n", x,
                           escapedHtml(name));
        x -= 6.6 * double(name.size()) + 6;
        svg += fmt::format("<path class='line s{} key' d='M{:.1f} 12h-18'/>\n", i, x);
        x -= 36;
    }
    return svg + "</svg>\n";
}

std::string escapedHtml(const std::string& text) {
    std::string out;
    for (const char c : text) {
        switch (c) {
            case '&':
                out += "&amp;";
                break;
            case '<':
                out += "&lt;";
                break;
            case '>':
                out += "&gt;";
                break;
            case '"':
                out += "&quot;";
                break;
            default:
                out += c;
        }
    }
    return out;
}

}  // namespace pietra
