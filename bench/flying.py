#!/usr/bin/env python3
"""Flights through models, cold and warm: frames, stalls, tolerance kept, memory; pages with graphs.

For each model and path a JSON report and an HTML page go to --folder. Memory is what the process had
in its largest frame beyond the budget and what it had before it opened the model. Errors: pictures of
frames of the orbit at several tolerances against the full mesh."""
import argparse
import json
import os
import pathlib
import tempfile

import common

PATHS = ("orbit", "dive", "flight", "jumps")
TOLERANCES = (0.5, 1, 2, 4)


def bytes_of(size):
    return int(float(size[:-1]) * 1024 ** (" kMG".index(size[-1])))


def fly(model, path, kind, options):
    name = f"{pathlib.Path(model).stem}-{path}-{kind}"
    extra = ["--cold"] if kind == "cold" else []
    if options.html:
        extra += ["--html", f"{options.folder}/{name}.html"]
    report = common.report("bench", model, "--path", path, "--size", options.size, "--pixels",
                           options.pixels, "--ram", options.ram, "--renderer", options.renderer, "--up",
                           options.up,
                           *extra, folder=options.folder)
    pathlib.Path(options.folder, f"{name}.json").write_text(json.dumps(report))
    return report["summary"]


def row(model, path, kind, s, options):
    over = s["largest_process_bytes"] - s["rss_before_bytes"] - bytes_of(options.ram)
    return [pathlib.Path(model).stem, path, kind, f"{s['ms']['median']:.1f}",
            f"{s['ms_of_all']['p99']:.1f}", f"{s['ms_of_all']['max']:.1f}", f"{s['stall_p99']:.2f}",
            f"{100 * s['converged']:.1f}", f"{s['triangles_per_second'] / 1e6:.1f}",
            f"{s['first_image_ms']:.0f}", f"{s['converged_ms']:.0f}", f"{s['overhead_ratio']:.2f}",
            f"{s['cold_overhead_ratio']:.2f}" if kind == "cold" else "",
            f"{s['bytes_read'] / 2**20:.1f}", f"{over / 2**20:+.0f}"]


def keys_of(model, path, options):
    """A standard path's keys, as a flight of a few frames reports them."""
    report = common.report("bench", model, "--path", path, "--size", options.size, "--frames", 2,
                           "--renderer", "none", "--up", options.up, folder=options.folder)
    return report["path"]["keys"]


def measure(model, options, tolerances=TOLERANCES, truth=None, path="orbit"):
    """By tolerance: triangles, measured depth error and largest error; medians over frames of a
    path, of the last the largest. Against all triangles of `truth`, a model of the same mesh; of
    this one, if None."""
    truth = truth or model
    keys = keys_of(truth, path, options)
    with tempfile.TemporaryDirectory() as folder:
        found = {t: [] for t in tolerances}
        for key in keys[5::max(len(keys) // options.views, 1)]:
            camera = pathlib.Path(folder, "camera.json")
            camera.write_text(json.dumps({k: v for k, v in key.items() if k != "t"}))
            shot = lambda name, t, of=model: common.report(
                "render", of, "-o", f"{folder}/{name}.png", "--camera", camera, "--size",
                options.size, "--pixels", t, folder=folder)
            shot("full", 0, truth)
            for t in tolerances:
                triangles = shot("cut", t)["triangles"]
                difference = json.loads(common.pietra("compare", f"{folder}/cut.png",
                                                      f"{folder}/full.png", "--json",
                                                      check=False).stdout)
                found[t].append((triangles, difference["depth_px"]["p99"], max(
                    difference[k]["max"] for k in ("coverage_px", "edge_px", "depth_px"))))
    return {t: (common.median([v[0] for v in views]), common.median([v[1] for v in views]),
                max(v[2] for v in views)) for t, views in found.items()}


def errors(model, options):
    for t, (triangles, p99, largest) in measure(model, options).items():
        yield [pathlib.Path(model).stem, t, f"{triangles:,.0f}", f"{p99:.3f}", f"{largest:.2f}"]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("models", nargs="+")
    parser.add_argument("--paths", default=",".join(PATHS))
    parser.add_argument("--kinds", default="warm,cold")
    parser.add_argument("--size", default="1280x1024")
    parser.add_argument("--pixels", default=1)
    parser.add_argument("--ram", default="1G")
    parser.add_argument("--renderer", default="cpu")
    parser.add_argument("--up", default="z")
    parser.add_argument("--html", action="store_true", help="pages with graphs, too: twice more flights")
    parser.add_argument("--views", type=int, default=0, help="measure errors in so many views")
    parser.add_argument("--folder", default="bench-output")
    options = parser.parse_args()
    os.makedirs(options.folder, exist_ok=True)
    rows = []
    for model in options.models:
        for path in options.paths.split(","):
            for kind in options.kinds.split(","):
                rows.append(row(model, path, kind, fly(model, path, kind, options), options))
                print(" | ".join(rows[-1]), flush=True)
    print(common.table(["model", "path", "", "frame, ms", "99 %", "longest", "stall_p99",
                        "% converged", "M triangles/s", "first image, ms", "converged, ms",
                        "overhead", "cold overhead", "MiB read", "MiB over budget"], rows))
    if options.views:
        print(common.table(["model", "tolerance, px", "triangles", "depth error, 99 %, px",
                            "largest error, px"],
                           [r for model in options.models for r in errors(model, options)]))


if __name__ == "__main__":
    main()
