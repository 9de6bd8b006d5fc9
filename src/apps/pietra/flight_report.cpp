#include "apps/pietra/flight_report.h"

#include <cmath>

namespace pietra {
namespace {

using Json = nlohmann::ordered_json;

/// JSON has no infinity: null.
Json finite(double value) {
    return std::isfinite(value) ? Json(value) : Json();
}

Json frameJson(const FrameRecord& f) {
    return {{"ms", f.ms},
            {"select_ms", f.select_ms},
            {"adapt_ms", f.adapt_ms},
            {"load_ms", f.load_ms},
            {"draw_ms", f.draw_ms},
            {"gpu_ms", f.gpu_ms},
            {"static_ms", f.static_ms},
            {"triangles", f.triangles},
            {"patches", f.patches},
            {"operations", f.operations},
            {"bytes_read", f.bytes_read},
            {"resident_bytes", f.resident_bytes},
            {"device_bytes", f.device_bytes},
            {"process_bytes", f.process_bytes},
            {"tolerance_px", finite(f.tolerance_px)},
            {"converged", f.converged}};
}

Json distribution(const std::vector<double>& values) {
    if (values.empty()) return nullptr;
    return {{"median", percentile(values, 0.5)},
            {"p95", percentile(values, 0.95)},
            {"p99", percentile(values, 0.99)},
            {"max", percentile(values, 1)}};
}

/// Sums and lists over the frames of a flight.
struct Totals {
    std::vector<double> ms, ms_kept, gpu_ms, stalls;
    double triangles_kept = 0, kept_ms = 0, all_ms = 0, static_ms = 0;
    double operations = 0, adapt_ms = 0;
    size_t converged = 0, process_bytes = 0;
    uint64_t bytes_read = 0;

    Totals(const std::vector<FrameRecord>& frames, double pixels) {
        for (const FrameRecord& f : frames) {
            ms.push_back(f.ms);
            all_ms += f.ms;
            if (f.gpu_ms > 0) gpu_ms.push_back(f.gpu_ms);
            static_ms += f.static_ms;
            operations += f.operations;
            adapt_ms += f.adapt_ms;
            if (f.static_ms > 0) stalls.push_back(f.ms / f.static_ms);
            converged += f.converged;
            bytes_read += f.bytes_read;
            process_bytes = std::max(process_bytes, f.process_bytes);
            if (f.tolerance_px > pixels) continue;
            ms_kept.push_back(f.ms);
            kept_ms += f.ms;
            triangles_kept += double(f.triangles);
        }
    }
};

}  // namespace

Json flightJson(const FlightRecord& record, double pixels, bool cold) {
    const Totals totals(record.frames, pixels);
    const double count = double(record.frames.size());
    Json summary{{"frames", record.frames.size()},
                 {"ms", distribution(totals.ms_kept)},
                 {"ms_of_all", distribution(totals.ms)},
                 {"gpu_ms", distribution(totals.gpu_ms)},
                 {"at_tolerance", double(totals.ms_kept.size()) / count},
                 {"converged", double(totals.converged) / count},
                 {"seconds", record.seconds},
                 {"triangles_per_second",
                  totals.kept_ms > 0 ? 1e3 * totals.triangles_kept / totals.kept_ms : 0},
                 {"operations_per_second",
                  totals.adapt_ms > 0 ? 1e3 * totals.operations / totals.adapt_ms : 0},
                 {"largest_process_bytes", totals.process_bytes},
                 {"bytes_read", totals.bytes_read},
                 {"first_image_ms", record.first_image_ms},
                 {"converged_ms", record.converged_ms}};
    if (totals.static_ms > 0) {
        summary["overhead_ratio"] = record.overhead_ratio;
        summary["stall_p99"] = percentile(totals.stalls, 0.99);
        if (cold) summary["cold_overhead_ratio"] = totals.all_ms / totals.static_ms;
    }
    Json frames = Json::array();
    for (const FrameRecord& frame : record.frames) frames.push_back(frameJson(frame));
    return {{"summary", summary}, {"frames", frames}};
}

}  // namespace pietra
