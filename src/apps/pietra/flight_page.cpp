#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "apps/pietra/flight_report.h"
#include "apps/pietra/line_chart.h"
#include "base/text.h"

namespace pietra {
namespace {

using Json = nlohmann::ordered_json;

/// Triangles a second are means over so many frames.
constexpr size_t kWindow = 15;
/// The axis of times goes up to this at least, and to twice what nearly all frames take.
constexpr double kLeastMs = 20;
/// Tolerances above are drawn at this height.
constexpr double kMostTolerance = 16;

constexpr const char* kHead = R"(<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>{title}</title><style>
:root {{ --ink:#22262b; --soft:#6b7280; --rule:#e3e6ea; --page:#fff; --tile:#f5f6f8;
  --s0:#1f6fb2; --s1:#d9822b; --s2:#7a9a3a; --limit:#b3402e; }}
@media (prefers-color-scheme:dark) {{ :root {{ --ink:#e4e6e9; --soft:#9aa2ad; --rule:#333941;
  --page:#16191d; --tile:#1f242a; --s0:#5aa9e6; --s1:#f0a04b; --s2:#a5c663; --limit:#ee7a66; }} }}
body {{ font:15px/1.45 system-ui,sans-serif; color:var(--ink); background:var(--page);
  max-width:940px; margin:2em auto; padding:0 20px; }}
h1 {{ font-size:24px; margin:0; font-weight:650; }} h2 {{ font-size:17px; margin:2em 0 .6em; }}
p {{ color:var(--soft); margin:.3em 0 1.4em; }}
.tiles {{ display:grid; grid-template-columns:repeat(auto-fill,minmax(165px,1fr)); gap:10px; }}
.tiles div {{ background:var(--tile); border-radius:8px; padding:10px 14px; }}
.tiles b {{ display:block; font-size:22px; font-weight:650; }}
.tiles span {{ color:var(--soft); font-size:13px; }}
svg {{ width:100%; height:auto; display:block; margin-top:22px; font:12px system-ui,sans-serif; }}
.title {{ fill:var(--ink); font-size:14px; font-weight:600; }} .label {{ fill:var(--soft); }}
.grid {{ stroke:var(--rule); }} .line {{ fill:none; stroke-width:1.2; stroke-linejoin:round; }}
.key {{ stroke-width:3; }}
.s0 {{ stroke:var(--s0); }} .s1 {{ stroke:var(--s1); }} .s2 {{ stroke:var(--s2); }}
table {{ border-collapse:collapse; width:100%; }}
td {{ border-top:1px solid var(--rule); padding:5px 8px 5px 0; vertical-align:top; }}
td:nth-child(2) {{ text-align:right; font-variant-numeric:tabular-nums; white-space:nowrap;
  padding-right:24px; }} td:last-child {{ color:var(--soft); }}
</style></head><body>
)";

using FrameValue = double (*)(const FrameRecord&);

ChartLine lineOf(const char* name, const FlightRecord& flight, FrameValue value) {
    ChartLine line{name, {}, {}};
    for (const FrameRecord& f : flight.frames) {
        line.x.push_back(f.seconds);
        line.y.push_back(value(f));
    }
    return line;
}

/// Millions of triangles a second, over the frames around each.
ChartLine rateOf(const char* name, const FlightRecord& flight) {
    ChartLine line{name, {}, {}};
    double triangles = 0, ms = 0;
    for (size_t i = 0; i < flight.frames.size(); ++i) {
        triangles += double(flight.frames[i].triangles);
        ms += flight.frames[i].ms;
        if (i >= kWindow) {
            triangles -= double(flight.frames[i - kWindow].triangles);
            ms -= flight.frames[i - kWindow].ms;
        }
        line.x.push_back(flight.frames[i].seconds);
        line.y.push_back(1e-3 * triangles / ms);
    }
    return line;
}

ChartLine summed(ChartLine line) {
    double sum = 0;
    for (double& y : line.y) y = sum += y;
    return line;
}

std::vector<LineChart> charts(const BenchRecord& record) {
    const FlightRecord& flight = record.flight;
    const auto ms = [](const FrameRecord& f) { return f.ms; };
    ChartLine times = lineOf("frames", flight, ms);
    const double most_ms = std::max(kLeastMs, 2 * percentile(times.y, 0.99));
    const auto mega = 1.0 / (1 << 20);
    std::vector<LineChart> charts{
        {"Time of a frame", "ms", {std::move(times)}, kLeastMs, most_ms},
        {"Triangles a second", "millions", {rateOf("with prefetching", flight)}},
        {"Triangles a frame",
         "thousands",
         {lineOf("", flight, [](const FrameRecord& f) { return 1e-3 * double(f.triangles); })}},
        {"Patches a frame",
         "",
         {lineOf("", flight, [](const FrameRecord& f) { return double(f.patches); })}},
        {"Tolerance kept",
         "pixels",
         {lineOf("", flight,
                 [](const FrameRecord& f) { return std::min(f.tolerance_px, kMostTolerance); })}},
        {"Memory",
         "MiB",
         {lineOf("pages", flight, [](const FrameRecord& f) { return double(f.resident_bytes); }),
          lineOf("process", flight, [](const FrameRecord& f) { return double(f.process_bytes); })}},
        {"Read from the file so far",
         "MiB",
         {summed(lineOf("", flight, [](const FrameRecord& f) { return double(f.bytes_read); }))}}};
    for (LineChart* chart : {&charts[5], &charts[6]})
        for (ChartLine& line : chart->lines)
            for (double& y : line.y) y *= mega;
    if (record.without_prefetch)
        charts[1].lines.push_back(rateOf("without", *record.without_prefetch));
    if (record.without_drawing)
        charts[0].lines.push_back(lineOf("without drawing", *record.without_drawing, ms));
    return charts;
}

/// A row of the table: a key of the summary, its value as people read it, what it is.
struct Fact {
    const char* key;
    std::string value, meaning;
    bool tile = false;
};

std::vector<Fact> facts(const BenchRecord& record, const Json& summary) {
    std::vector<Fact> facts;
    const auto number = [&](const Json& value, const char* format) {
        return value.is_number() ? fmt::format(fmt::runtime(format), value.get<double>()) : "none";
    };
    const auto add = [&](const char* key, const char* pointer, const char* format,
                         const char* meaning, bool tile = false) {
        const Json::json_pointer place(pointer);
        if (!summary.contains(place)) return;
        facts.push_back({key, number(summary.at(place), format), meaning, tile});
    };
    const auto addBytes = [&](const char* key, uint64_t bytes, const char* meaning, bool tile) {
        facts.push_back({key, formatBytes(bytes), meaning, tile});
    };
    add("frames", "/frames", "{:.0f}", "frames flown");
    add("median frame", "/ms/median", "{:.1f} ms", "of the frames at the tolerance asked for",
        true);
    add("99 % of frames", "/ms/p99", "{:.1f} ms", "take no longer", true);
    add("longest frame", "/ms_of_all/max", "{:.1f} ms", "of all frames", true);
    const double rate = summary["triangles_per_second"];
    facts.push_back({"triangles a second", formatCount(rate), "at the tolerance asked for", true});
    add("at tolerance", "/at_tolerance", "{:.3f}", "share of frames that keep the tolerance");
    add("converged", "/converged", "{:.3f}", "share of frames that nothing is missing from", true);
    add("first image", "/first_image_ms", "{:.0f} ms",
        "from the start of the process to a picture at 16 pixels or finer", true);
    add("converged after", "/converged_ms", "{:.0f} ms", "after the camera's stop", true);
    add("overhead ratio", "/overhead_ratio", "{:.3f}",
        "a frame with everything resident over drawing its list as a static one", true);
    add("stall ratio, 99 %", "/stall_p99", "{:.2f}",
        "a frame of the flight over drawing its view as a static list");
    add("cold overhead ratio", "/cold_overhead_ratio", "{:.3f}",
        "all frames of the cold flight over drawing their views without selection and loading",
        true);
    addBytes("peak memory", summary["largest_process_bytes"], "resident set of the process", true);
    addBytes("memory before", record.process_bytes_before, "the models were opened", false);
    addBytes("read", summary["bytes_read"], "from the files, compressed", true);
    return facts;
}

}  // namespace

std::string flightPage(const BenchRecord& record, const Json& report) {
    const Json& model = report["model"];
    const std::string name =
        model.is_string() ? model.get<std::string>() : fmt::format("{} models", model.size());
    const std::string title = fmt::format("A flight through {}", name.substr(name.rfind('/') + 1));
    std::string page = fmt::format(kHead, fmt::arg("title", escapedHtml(title)));
    page += fmt::format("<h1>{}</h1>\n<p>{}</p>\n", escapedHtml(title),
                        escapedHtml(report["about"].get<std::string>()));
    const std::vector<Fact> all = facts(record, report["summary"]);
    page += "<div class=tiles>\n";
    for (const Fact& fact : all)
        if (fact.tile)
            page += fmt::format("<div><b>{}</b><span>{}</span></div>\n", fact.value, fact.key);
    page += "</div>\n";
    for (const LineChart& chart : charts(record)) page += lineChartSvg(chart);
    page += "<h2>All figures</h2>\n<table>\n";
    for (const Fact& fact : all)
        page += fmt::format("<tr><td>{}<td>{}<td>{}\n", fact.key, fact.value, fact.meaning);
    return page + "</table>\n</body></html>\n";
}

}  // namespace pietra
