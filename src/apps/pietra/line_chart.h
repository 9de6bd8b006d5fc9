#pragma once
// Charts of lines over time as SVG, for pages that stand by themselves: no script, no fonts, no
// network. Colours come from the page's style: classes s0, s1, ... for lines, grid, label.

#include <string>
#include <vector>

namespace pietra {

struct ChartLine {
    std::string name;       ///< for the legend
    std::vector<double> x;  ///< increasing
    std::vector<double> y;  ///< as long; a value that is not finite leaves a gap
};

struct LineChart {
    std::string title;
    std::string unit;              ///< of y
    std::vector<ChartLine> lines;  ///< later ones are drawn below
    double least_top = 0;          ///< the axis goes up to this at least,
    double most_top = 1e300;       ///< and to this at most: what lies above is drawn at the edge
};

/// An <svg> element. The axis of x is in seconds, and both begin at 0.
std::string lineChartSvg(const LineChart& chart);

/// With & < > " replaced: for text and attributes.
std::string escapedHtml(const std::string& text);

}  // namespace pietra
