#!/usr/bin/env python3
"""Wu and Huang's tables 1 to 4, repeated with the method `cluster`: construction (tables 1 to 3), and frames
at 1024x1024 and 1 px along an inspection path, with and without culling, by the paper's criterion and by
error (table 4).

Tables go to --page between the lines that say so. Meshes are made in --folder; those of the default need 25 GB
there, and the shared data. Nothing is built twice: models that exist there are taken with their reports."""
import argparse
import json
import math
import os
import pathlib

import common
import construction
import methods

LOCAL_LAYERS = 3


def synth(folder, name, *arguments):
    out = pathlib.Path(folder) / name
    if not out.exists():
        common.pietra("synth", *arguments, "-o", out)
    return out


def armadillo(folder):
    mesh = common.shared_mesh("scans/armadillo_86k.obj", folder)
    return mesh and synth(folder, "armadillo-89M.ply", "subdivide", mesh, "--levels", 5)


MESHES = {
    "dragon": construction.MESHES["dragon"],
    "sphere-63M": lambda f: synth(f, "sphere-63M.ply", "sphere", "--triangles", 62914560),
    "armadillo-89M": armadillo,
    "moon-118M": construction.MESHES["moon-118M"],
    "statue-271M": lambda f: synth(f, "statue-271M.ply", "statue", "--triangles", 270860288),
}


def build(mesh, name, options):
    """The model, and the report of its construction with the input's size and its own levels."""
    model = pathlib.Path(options.folder) / f"{name}-cluster.pietra"
    told = model.with_suffix(".json")
    if not model.exists() or not told.exists():
        made = common.report("build", mesh, "-o", model, "--method", "cluster", "--memory",
                             options.memory, folder=options.folder)
        made["info"] = json.loads(common.pietra("info", model, "--json").stdout)
        told.write_text(json.dumps(made))
    return model, json.loads(told.read_text())


def construction_row(name, made):
    seconds, triangles = made["seconds"], made["input"]["triangles"]
    local, total = seconds["local_trees"], seconds["total"]
    whole = seconds["global_tree"]
    global_layers = made["info"]["levels"] - 1 - LOCAL_LAYERS
    return [name, f"{triangles:,}", f"{made['input']['bytes'] / 2**30:.2f}",
            f"{made['peak_rss_bytes'] / 2**20:.0f}", f"{total - local - whole:.1f}",
            f"{local:.1f}", global_layers, f"{whole:.2f}", f"{triangles / total / 1000:.0f}",
            f"{made['output_bytes'] / triangles:.2f}"]


def fly(model, select, cull, options):
    # Frames without culling may take a second.
    frame_count = options.frames if cull == "all" else options.frames // 5
    made = common.report("bench", model, "--path", "inspection", "--size", "1024x1024", "--pixels",
                         1, "--select", select, "--cull", cull, "--frames", frame_count, "--ram",
                         options.ram, "--only-fly", folder=options.folder)
    frames = made["frames"]
    mean = sum(frame["ms"] for frame in frames) / len(frames)
    return {"fps": 1000 / mean, "setup": made["summary"]["first_image_ms"] / 1000,
            "triangles": common.median([frame["triangles"] for frame in frames]),
            "kept": sum((frame["tolerance_px"] or math.inf) <= 1 for frame in frames) / len(frames)}


def flight_row(name, select, model, options):
    none, culled = fly(model, select, "none", options), fly(model, select, "all", options)
    return [name, select, f"{culled['setup']:.2f}", f"{none['fps']:.0f}", f"{culled['fps']:.0f}",
            f"{none['triangles']:,.0f}", f"{culled['triangles']:,.0f}", f"{100 * culled['kept']:.0f}"]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("meshes", nargs="*", default=list(MESHES))
    parser.add_argument("--memory", default="1G", help="of construction")
    parser.add_argument("--ram", default="1G", help="of flights")
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--page", default=common.ROOT / "src/methods/cluster/README.md",
                        type=pathlib.Path)
    parser.add_argument("--folder", default="bench-output")
    options = parser.parse_args()
    options.folder = os.path.abspath(options.folder)
    os.makedirs(options.folder, exist_ok=True)
    built, flown = [], []
    for name in options.meshes:
        model = pathlib.Path(options.folder) / f"{name}-cluster.pietra"
        mesh = None if model.exists() else MESHES[name](options.folder)
        if mesh is None and not model.exists():
            print(f"{name}: the shared data is absent, left out")
            continue
        model, made = build(mesh, name, options)
        built.append(construction_row(name, made))
        print(*built[-1], sep=" | ", flush=True)
        for select in ("area", "error"):
            flown.append(flight_row(name, select, model, options))
            print(*flown[-1], sep=" | ", flush=True)
    methods.replace_between(options.page, "construction", common.table(
        ["mesh", "triangles", "input, GiB", "peak memory, MiB", "octree, s",
         f"local trees ({LOCAL_LAYERS} layers), s", "depth, and layers of the global tree", "its time, s",
         "k triangles/s", "file, bytes a triangle"], built))
    methods.replace_between(options.page, "flights", common.table(
        ["mesh", "`--select`", "setup, s", "frames/s, no culling", "frames/s", "triangles, no culling",
         "triangles", "frames at 1 px, %"], flown))


if __name__ == "__main__":
    main()
