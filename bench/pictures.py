#!/usr/bin/env python3
"""Is the picture right? For random views of models, compares the cut at a tolerance with the full mesh.

Pictures are supersampled: with --scale 4 and --pixels 1, both are drawn at four times the size, the cut
at four of those pixels, so distances are in pixels of a picture with 4x4 samples each. A view is a
fault where a silhouette or depth edge is further off than the tolerance plus one pixel."""
import argparse
import json
import math
import os
import pathlib
import random

import common


def cameras(bounds, count, seed):
    """Views from all around, from the whole model to close above the surface's bounds."""
    rng = random.Random(seed)
    low, high = bounds["min"], bounds["max"]
    centre = [(a + b) / 2 for a, b in zip(low, high)]
    radius = math.dist(low, high) / 2
    for _ in range(count):
        direction = [rng.gauss(0, 1) for _ in range(3)]
        length = math.hypot(*direction)
        distance = radius * math.exp(rng.uniform(math.log(0.6), math.log(3.5)))
        target = [c + rng.uniform(-0.4, 0.4) * (b - a) for c, a, b in zip(centre, low, high)]
        eye = [t + distance * d / length for t, d in zip(target, direction)]
        yield {"eye": eye, "target": target, "up": [0, 0, 1], "fovy_deg": rng.uniform(25, 60)}


def compare(model, camera, options, folder):
    path = pathlib.Path(folder)
    (path / "camera.json").write_text(json.dumps(camera))
    width, height = (int(x) * options.scale for x in options.size.split("x"))
    for name, pixels in (("cut", options.pixels * options.scale), ("full", 0)):
        common.pietra("render", model, "-o", path / f"{name}.png", "--force", "--camera",
                      path / "camera.json", "--size", f"{width}x{height}", "--pixels", pixels)
    return json.loads(common.pietra("compare", path / "cut.png", path / "full.png", "--json",
                                    "--supersampled", options.scale, check=False).stdout)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("models", nargs="+")
    parser.add_argument("--views", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--pixels", type=float, default=1)
    parser.add_argument("--scale", type=int, default=4)
    parser.add_argument("--size", default="320x256")
    parser.add_argument("--folder", default="bench-output")
    options = parser.parse_args()
    os.makedirs(options.folder, exist_ok=True)
    rows, limit = [], options.pixels + 1
    for model in options.models:
        info = json.loads(common.pietra("info", model, "--json").stdout)
        silhouette, edges, hairlines, shade, faults = [], [], [], [], 0
        for camera in cameras(info["bounds"], options.views, options.seed):
            found = compare(model, camera, options, options.folder)
            silhouette.append(found["coverage_px"]["max"])
            edges.append(found["edge_px"]["max"])
            hairlines.append(sum(found["hairlines"].values()))
            shade.append(found["shade"]["mean"])
            if max(silhouette[-1], edges[-1]) > limit:
                faults += 1
                print(f"{model}: silhouette {silhouette[-1]:.2f} px, depth edge {edges[-1]:.2f} px: "
                      f"{json.dumps(camera)}", flush=True)
        rows.append([pathlib.Path(model).stem, options.views, f"{max(silhouette):.2f}",
                     f"{max(edges):.2f}", max(hairlines), f"{common.median(shade):.2f}", faults])
        print(" | ".join(map(str, rows[-1])), flush=True)
    print(common.table(["model", "views", "largest silhouette distance, px",
                        "largest depth edge distance, px", "most pixels of hairlines",
                        "median mean shade difference of 255", f"views beyond {limit:g} px"], rows))


if __name__ == "__main__":
    main()
