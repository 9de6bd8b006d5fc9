#!/usr/bin/env python3
"""Progressive meshes as Derzapf, Menzel and Guthe (2011) measured theirs: tables 2 to 5, figures 4 and 5.

For each mesh: what a model holds; flights around and into it at 1920x1080, out of core, in core (its
memory with all operations, counted), as an indexed mesh (all of it drawn; its memory counted) and by
`tetra`, which stands for HLODs; and triangles at equal measured errors, against `tetra`. Frames' times,
memory and triangles go to --folder as figure-MESH-PATH.csv. The script fails where a frame out of core
held more than --ram. Names of meshes are those of construction.py, or files."""
import argparse
import csv
import json
import os
import pathlib

import common
import construction
import flying

PIXEL_SIZE = "1920x1080"
VERTEX_BYTES, TRIANGLE_BYTES = 24, 12  # of an indexed mesh: position and normal as floats
MIB = 2**20
LARGE = 2_000_000  # operations: an indexed mesh is not drawn
# Of what is held: a node, an operation, a vertex with its triangles and chunk.
NODE, OPERATION, VERTEX = 73_656, 108, 280
MODES = {  # method, options of bench
    "out of core": ("pmesh", []),
    "in core": ("pmesh", ["--cull", "frustum", "--ram", "8G"]),
    "indexed mesh": ("pmesh", ["--cull", "frustum", "--ram", "8G", "--pixels", 0]),
    "tetra": ("tetra", ["--ram", "8G"]),
}


def build(mesh, method, options):
    model = f"{options.folder}/{pathlib.Path(mesh).stem}-{method}.pietra"
    made = pathlib.Path(model + ".json")
    if not made.exists():
        made.write_text(json.dumps(common.report("build", mesh, "-o", model, "--method", method,
                                                 folder=options.folder)))
    info = json.loads(common.pietra("info", model, "--json").stdout)
    return model, {**info, **json.loads(made.read_text())}


def indexed_bytes(made):
    return (VERTEX_BYTES * made["input"]["vertices"] + TRIANGLE_BYTES * made["input"]["triangles"])


def holds(name, made):
    """Tables 2 and 3."""
    vertices, triangles = made["input"]["vertices"], made["input"]["triangles"]
    operations = made["vertices_stored"]
    return [name, f"{vertices:,}", f"{triangles:,}", f"{operations:,}",
            made["levels"], made["nodes"], f"{made['bytes'] / operations:.1f}",
            f"{100 * made['bytes'] / indexed_bytes(made):.0f}"]


def same_path(model, path, options):
    """A file of it: models place standard paths by what they draw first, each its own."""
    file = pathlib.Path(options.folder, f"{pathlib.Path(model).stem}-{path}.json")
    report = common.report("bench", model, "--path", path, "--frames", 2, "--renderer", "none",
                           "--up", options.up, folder=options.folder)
    file.write_text(json.dumps(report["path"]))
    return file


def fly(model, path, mode, options):
    extra = MODES[mode][1]
    chosen = [x for k, v in (("--ram", options.ram), ("--pixels", options.pixels))
              if k not in extra for x in (k, v)]
    report = common.report("bench", model, "--path", path, "--size", PIXEL_SIZE, "--frames",
                           options.frames, "--up", options.up, "--renderer", options.renderer, *chosen,
                           *extra, folder=options.folder)
    if mode == "out of core":
        most = max(f["resident_bytes"] for f in report["frames"])
        if most > flying.bytes_of(options.ram):
            raise SystemExit(f"{model}: a frame held {most} bytes, more than {options.ram}")
    return report


def table_1(nodes, operations, vertices, attributes=6):
    """The paper's bytes."""
    return 13 * nodes + (12 + 2 * attributes) * operations + (102 + 4 * attributes) * vertices


def memory(mode, made, frame):
    """Bytes, and those of the paper's table 1."""
    held, vertices = frame["resident_bytes"], frame["triangles"] // 2
    nodes, operations = made["nodes"], made["vertices_stored"]
    if mode == "out of core":
        loaded = max(held - VERTEX * vertices, 0) // OPERATION
        return held, table_1(nodes, loaded, vertices)
    if mode == "in core":
        return NODE * nodes + VERTEX * vertices, table_1(nodes, operations, vertices)
    return (indexed_bytes(made) if mode == "indexed mesh" else held), None


def flights(name, made, path, options):
    """Tables 4 and 5, of the most complex frame; and the figures' series."""
    large = made["pmesh"][1]["vertices_stored"] > LARGE
    file = same_path(made["tetra"][0], path, options)
    reports = {mode: fly(made[method][0], file, mode, options)
               for mode, (method, _) in MODES.items() if not (large and mode == "indexed mesh")}
    series = list(zip(*(report["frames"] for report in reports.values())))
    with open(f"{options.folder}/figure-{name}-{path}.csv", "w", newline="") as out:
        kinds = ("ms", "adapt_ms", "draw_ms", "triangles", "resident_bytes", "operations")
        rows = csv.writer(out)
        rows.writerow(["frame", *(f"{mode}: {kind}" for mode in reports for kind in kinds)])
        for i, frames in enumerate(series):
            rows.writerow([i, *(f[kind] for f in frames for kind in kinds)])
    worst = max(range(len(series)), key=lambda i: series[i][0]["triangles"])
    for mode, report in reports.items():
        frames, s = report["frames"], report["summary"]
        triangles, ms = frames[worst]["triangles"], s["ms_of_all"]["median"]
        if mode == "indexed mesh":  # adapting to all of it takes more than a frame
            triangles = made["pmesh"][1]["input"]["triangles"]
            ms = common.median([f["static_ms"] for f in frames])
        held, papers = memory(mode, made["pmesh"][1], frames[worst])
        yield [name, path, mode, f"{triangles:,}",
               f"{triangles / series[worst][0]['triangles']:.2f}", f"{held / MIB:.1f}",
               f"{papers / MIB:.1f}" if papers else "", f"{ms:.1f}",
               f"{common.median([f['adapt_ms'] for f in frames]):.2f}", f"{s['stall_p99']:.2f}",
               f"{s['overhead_ratio']:.2f}"]


def at_equal_errors(name, models, path, options):
    """Triangles of `pmesh` over those of `tetra`, where the measured errors are the same."""
    at = lambda method, tolerances: sorted(
        (error, triangles) for triangles, error, _ in
        flying.measure(models[method], options, tolerances, models["tetra"], path).values())
    found = {"tetra": at("tetra", flying.TOLERANCES),
             "pmesh": at("pmesh", (0.125, 0.25, *flying.TOLERANCES))}
    for error, triangles in found["tetra"]:
        own = common.between(found["pmesh"], error)
        if own:
            yield [name, path, f"{error:.3f}", f"{triangles:,.0f}", f"{own:,.0f}", f"{own / triangles:.2f}"]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("meshes", nargs="*", default=["turbine", "dragon"])
    parser.add_argument("--paths", default="orbit,dive")
    parser.add_argument("--frames", type=int, default=480)
    parser.add_argument("--pixels", default=1)
    parser.add_argument("--ram", default="256M")
    parser.add_argument("--renderer", default="cpu")
    parser.add_argument("--up", default="z")
    parser.add_argument("--views", type=int, default=4, help="measure errors in so many views")
    parser.add_argument("--folder", default="bench-output")
    options = parser.parse_args()
    options.size = PIXEL_SIZE
    os.makedirs(options.folder, exist_ok=True)
    held, flown, equal = [], [], []
    for name in options.meshes:
        mesh = construction.MESHES[name](options.folder) if name in construction.MESHES else name
        if mesh is None:
            print(f"{name}: the shared data is absent, left out")
            continue
        name = pathlib.Path(name).stem
        made = {method: build(mesh, method, options) for method in ("pmesh", "tetra")}
        held.append(holds(name, made["pmesh"][1]))
        for path in options.paths.split(","):
            flown += flights(name, made, path, options)
            print(*(" | ".join(row) for row in flown[-len(MODES):]), sep="\n", flush=True)
            if options.views:
                equal += at_equal_errors(name, {m: model for m, (model, _) in made.items()}, path,
                                         options)
    print(common.table(["mesh", "vertices", "triangles", "operations", "levels", "nodes",
                        "bytes an operation", "% of an indexed mesh"], held))
    print(common.table(["mesh", "path", "", "triangles", "of out of core", "memory, MiB", "by its table 1", "frame, ms",
                        "adapt, ms", "stall_p99", "overhead"], flown))
    print(common.table(["mesh", "path", "depth error, 99 %, px", "triangles, tetra", "pmesh", "ratio"], equal))


if __name__ == "__main__":
    main()
