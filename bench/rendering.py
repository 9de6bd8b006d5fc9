#!/usr/bin/env python3
"""Pictures by stage, and flights: what `render` and `bench` take on given models, on the processor.

Medians of --repeat runs. Loading and decoding are summed over threads and go on while batches are
drawn. Flights are warm, as fast as they can; the first image counts from the start of the process."""
import argparse
import os

import common

STAGES = ("select", "load", "decode", "draw", "total")


def pictures(model, options):
    for samples in (1, 4):
        runs = [common.report("render", model, "-o", f"{options.folder}/x.png", "--view", "iso",
                              "--samples", samples, "--size", options.size, folder=options.folder)
                for _ in range(options.repeat)]
        yield [os.path.basename(model), samples, f"{runs[0]['triangles']:,}",
               *(f"{common.median([run['ms'][stage] for run in runs]):.0f}" for stage in STAGES)]


def flights(model, options):
    for path in ("orbit", "dive", "flight", "jumps"):
        runs = [common.report("bench", model, "--path", path, "--size", options.size, "--frames",
                              options.frames, folder=options.folder)["summary"]
                for _ in range(options.repeat)]
        pick = lambda get: common.median([get(run) for run in runs])
        yield [os.path.basename(model), path, f"{pick(lambda r: r['ms']['median']):.1f}",
               f"{pick(lambda r: r['ms']['p99']):.1f}",
               f"{pick(lambda r: r['triangles_per_second']) / 1e6:.0f} M",
               f"{pick(lambda r: r['overhead_ratio']):.2f}",
               f"{pick(lambda r: r['first_image_ms']):.0f}",
               f"{pick(lambda r: r['converged_ms']):.0f}"]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("models", nargs="+")
    parser.add_argument("--size", default="1280x1024")
    parser.add_argument("--frames", type=int, default=600)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--folder", default="bench-output")
    options = parser.parse_args()
    os.makedirs(options.folder, exist_ok=True)
    drawn = [row for model in options.models for row in pictures(model, options)]
    print(common.table(["model", "samples", "triangles", *(f"{s}, ms" for s in STAGES)], drawn))
    flown = [row for model in options.models for row in flights(model, options)]
    print(common.table(["model", "path", "frame, ms", "99 %, ms", "triangles/s", "over a static draw",
                        "first image, ms", "converged, ms"], flown))


if __name__ == "__main__":
    main()
