#!/usr/bin/env python3
"""Pictures by stage: what `render` takes on given models, on the processor.

Medians of --repeat runs. Loading and decoding are summed over threads and go on while batches are
drawn. Flights: flying.py."""
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


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("models", nargs="+")
    parser.add_argument("--size", default="1280x1024")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--folder", default="bench-output")
    options = parser.parse_args()
    os.makedirs(options.folder, exist_ok=True)
    drawn = [row for model in options.models for row in pictures(model, options)]
    print(common.table(["model", "samples", "triangles", *(f"{s}, ms" for s in STAGES)], drawn))


if __name__ == "__main__":
    main()
