#!/usr/bin/env python3
"""How tight the stated errors are: stated over measured, over the diamonds of each level.

Measured is dense sampling both ways (`pietra check --input`). Levels with fewer than three diamonds
are left out. Needs the shared data (PIETRA_SHARED or ../shared); takes some minutes."""
import argparse
import json
import os

import common

MESHES = {
    "dragon": "scans/dragon_vrip.ply.gz",
    "turbine blade": "scans/turbineblade.ply",
    "Igea": "scans/igea_tristrip.ply",
    "armadillo": "scans/armadillo_86k.obj",
    "lion statue": "scans/lionstatue.obj",
    "Nefertiti": "scans/nefertiti.obj",
    "gargo": "coloured/gargo_vcolor.ply",
    "laurana": "coloured/laurana_vcolor.ply",
    "snowden bust": "dirty/snowden_bust.ply",
    "shark": "dirty/Grey_Nurse_Shark.stl",
    "cycloidal": "cad/cycloidal.ply",
    "counter": "cad/counter.unitsmm.STL",
}


def levels_of(mesh, options):
    model = f"{options.folder}/model.pietra"
    common.pietra("build", mesh, "-o", model, "--force")
    checked = json.loads(common.pietra("check", model, "--input", mesh, "--json").stdout)
    if not checked["ok"]:
        raise SystemExit(f"{mesh}: the check failed")
    return [level for level in checked["certificate"]["stated_over_measured"] if level["groups"] > 2]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--meshes", default=",".join(MESHES))
    parser.add_argument("--folder", default="bench-output")
    options = parser.parse_args()
    os.makedirs(options.folder, exist_ok=True)
    rows, least = [], []
    for name in options.meshes.split(","):
        mesh = common.shared_mesh(MESHES[name], options.folder)
        if mesh is None:
            print(f"{name}: the shared data is absent, left out")
            continue
        levels = levels_of(mesh, options)
        least += [level["least"] for level in levels]
        rows.append([name, " ".join(f"{level['median']:.1f}" for level in levels),
                     f"{max(level['p95'] for level in levels):.1f}"])
    print(common.table(["mesh", "median by level, finest first", "largest 95th percentile"], rows))
    print(f"least of all: {min(least):.3f}")


if __name__ == "__main__":
    main()
