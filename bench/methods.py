#!/usr/bin/env python3
"""The methods side by side: the same meshes, paths and *measured* errors of the picture.

Each method flies at the tolerance at which its pictures are as far off as `tetra`'s at --pixels: 99 % of
depth errors, medians over views of the orbit, found between tolerances from 1/8 to 8 px. Between the
lines that say so in --page go the tables, beside it the plot (python3-matplotlib). Meshes are those of
construction.py, or files."""
import argparse
import os
import pathlib
import re

import common
import construction
import flying
import progressive

TOLERANCES = (0.125, 0.25, 0.5, 1, 2, 4, 8)
METHODS = ("tetra", "pmesh", "cluster")


class Model:
    """One mesh by one method: built, and its pictures measured."""

    def __init__(self, mesh, method, truth, options):
        self.path, self.made = progressive.build(mesh, method, options)
        measured = flying.measure(self.path, options, TOLERANCES, truth)
        self.measured = {t: (triangles, error) for t, (triangles, error, _) in measured.items()}

    def tolerance_for(self, error):
        return common.between(((e, t) for t, (_, e) in self.measured.items()), error)

    def triangles_for(self, error):
        return common.between(((e, n) for n, e in self.measured.values()), error)


def construction_row(name, method, made):
    triangles = made["input"]["triangles"]
    return [name, f"{triangles:,}", f"`{method}`", f"{made['triangles_per_second'] / 1000:.0f}",
            f"{made['peak_rss_bytes'] / 2**20:.0f}", f"{made['bytes'] / triangles:.1f}"]


def flight_rows(name, models, path, error, options):
    for method, model in models.items():
        tolerance = model.tolerance_for(error)
        if tolerance is None:
            yield [name, path, f"`{method}`", "", "", "", "", "", ""]
            continue
        s = common.report("bench", model.path, "--path", path, "--size", options.size, "--pixels",
                          f"{tolerance:.3f}", "--ram", options.ram, "--renderer", options.renderer,
                          "--up", options.up, "--cold", folder=options.folder)["summary"]
        yield [name, path, f"`{method}`", f"{tolerance:.2f}",
               f"{model.triangles_for(error):,.0f}", f"{s['ms']['median']:.1f}",
               f"{s['ms_of_all']['p99']:.1f}", f"{s['stall_p99']:.2f}",
               f"{s['bytes_read'] / 2**20:.1f}"]


def plot(all_models, file):
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot
    figure, axes = pyplot.subplots(1, len(all_models), figsize=(4 * len(all_models), 3.4),
                                   squeeze=False, layout="constrained")
    for ax, (name, models) in zip(axes[0], all_models.items()):
        for method, model in models.items():
            points = sorted((e, n) for n, e in model.measured.values() if e > 0)
            ax.loglog(*zip(*points), marker="o", markersize=3, label=method)
        ax.set(title=name, xlabel="measured error, px")
        ax.grid(True, which="both", linewidth=0.3)
    axes[0][0].set_ylabel("triangles drawn")
    axes[0][0].legend()
    figure.savefig(file, dpi=90)


def replace_between(page, name, text):
    """What stands between the lines <!-- NAME --> and <!-- /NAME -->."""
    pattern = re.compile(rf"(<!-- {name} -->\n).*?(<!-- /{name} -->)", re.DOTALL)
    old = page.read_text()
    if not pattern.search(old):
        raise SystemExit(f"{page}: no lines <!-- {name} --> and <!-- /{name} -->")
    page.write_text(pattern.sub(lambda m: m[1] + text + "\n" + m[2], old))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("meshes", nargs="*", default=["turbine", "dragon", "moon-2M"])
    parser.add_argument("--methods", default=",".join(METHODS))
    parser.add_argument("--paths", default="orbit,flight")
    parser.add_argument("--pixels", type=float, default=1)
    parser.add_argument("--size", default="1280x1024")
    parser.add_argument("--ram", default="1G")
    parser.add_argument("--renderer", default="cpu")
    parser.add_argument("--up", default="z")
    parser.add_argument("--views", type=int, default=6, help="measure errors in so many views")
    parser.add_argument("--page", default=common.ROOT / "docs/methods.md", type=pathlib.Path)
    parser.add_argument("--folder", default="bench-output")
    options = parser.parse_args()
    os.makedirs(options.folder, exist_ok=True)
    all_models, built, flown = {}, [], []
    for name in options.meshes:
        mesh = construction.MESHES[name](options.folder) if name in construction.MESHES else name
        if mesh is None:
            print(f"{name}: the shared data is absent, left out")
            continue
        name = pathlib.Path(name).stem
        truth, _ = progressive.build(mesh, "tetra", options)
        models = {m: Model(mesh, m, truth, options) for m in options.methods.split(",")}
        all_models[name] = models
        built += [construction_row(name, method, model.made) for method, model in models.items()]
        error = common.between(((t, e) for t, (_, e) in models["tetra"].measured.items()), options.pixels)
        for path in options.paths.split(","):
            rows = list(flight_rows(name, models, path, error, options))
            print(*(" | ".join(row) for row in rows), sep="\n", flush=True)
            flown += rows
    replace_between(options.page, "construction", common.table(
        ["mesh", "triangles", "method", "built, k triangles/s", "peak memory, MiB",
         "file, bytes a triangle"], built))
    replace_between(options.page, "flights", common.table(
        ["mesh", "path", "method", "tolerance, px", "triangles", "frame, ms", "99 %", "`stall_p99`",
         "MiB read"], flown))
    plot(all_models, options.page.parent / "pictures/methods.png")


if __name__ == "__main__":
    main()
