#pragma once
// What `bench` says of a flight: as JSON, and as a page for people.

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "apps/pietra/flight.h"

namespace pietra {

/// A flight, and the same again in other ways where that was asked for.
struct BenchRecord {
    FlightRecord flight;
    std::optional<FlightRecord> without_prefetch, without_drawing;
    size_t process_bytes_before = 0;  ///< resident, before the models were opened
    size_t peak_bytes = 0;            ///< up to the end of the flight
};

/// `frames` and `summary`, as the report has them. `pixels`: the tolerance asked for.
/// `cold_overhead_ratio`, of cold flights: what all frames took over what drawing the same views
/// takes without selection and loading.
nlohmann::ordered_json flightJson(const FlightRecord& record, double pixels, bool cold);

/// One HTML file that needs nothing else: all of ATP's figure 7 (triangles a second with and
/// without prefetching, triangles and patches a frame, the flight without drawing), tolerance,
/// memory, what was read, and a table. `report` is the JSON report.
std::string flightPage(const BenchRecord& record, const nlohmann::ordered_json& report);

}  // namespace pietra
