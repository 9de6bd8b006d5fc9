#!/usr/bin/env python3
"""Readers of meshes beside those of other libraries, and construction from each form.

Files are made of `pietra synth statue` unless given. Readers take turns, one reading a process; times
are medians of processor seconds, as the machine may be shared. Rivals are those that bench_readers
was built with (-DPIETRA_BENCH=ON)."""
import argparse
import pathlib
import resource
import subprocess
import tempfile

import common

BENCH = common.ROOT / "build/release/bench_readers"
FORMS = {"binary PLY": "mesh.ply", "ascii PLY": "ascii.ply", "OBJ": "mesh.obj", "binary STL": "mesh.stl",
         "text STL": "text.stl", "GLB": "mesh.glb"}


def make(form, triangles, folder):
    """The file of a form."""
    path = folder / FORMS[form]
    if path.stem == "mesh":
        common.pietra("synth", "statue", "--triangles", triangles, "-o", path, "--force")
    else:
        subprocess.run([BENCH, "--ascii", make("binary PLY", triangles, folder), path], check=True)
    return path


def rivals(path):
    lines = subprocess.run([BENCH, "--list"], capture_output=True, text=True, check=True).stdout
    names = [line.split() for line in lines.splitlines()]
    return [name for name, *endings in names if path.suffix in endings and not name.startswith("pietra")]


def read_once(reader, path):
    """Triangles, processor seconds, peak MiB; None if the reader does not get through."""
    run = subprocess.run([BENCH, reader, path], capture_output=True, text=True)
    if run.returncode != 0:
        return None
    triangles, _, _, cpu, peak = run.stdout.split()
    return int(triangles), float(cpu), int(peak) / 2**20


def measure(form, path, repeat):
    """A row of the table."""
    names = ["pietra", *rivals(path)]
    runs = {name: [] for name in names}
    for _ in range(repeat):
        for name in names:
            runs[name].append(read_once(name, path))
    row = [form, f"{path.stat().st_size / 1e6:.0f} MB"]
    triangles, own = runs["pietra"][0][0], common.median([run[1] for run in runs["pietra"]])
    for name in names:
        if None in runs[name]:
            row.append(f"{name}: fails")
            continue
        cpu, peak = (common.median([run[k] for run in runs[name]]) for k in (1, 2))
        beside = f"{triangles / cpu / 1e6:.0f} M/s" if name == "pietra" else f"{name} {cpu / own:.1f} times"
        row.append(f"{beside}, {cpu:.3f} s, {peak:.0f} MiB")
    return row


def construction(form, path, folder):
    """Triangles a second of one core's time, and of the clock."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    report = common.report("build", path, "-o", folder / "x.pietra", folder=folder)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return [form, f"{report['input']['triangles'] / cpu / 1e3:.0f} k/s",
            f"{report['triangles_per_second'] / 1e3:.0f} k/s",
            f"{report['peak_rss_bytes'] / 2**20:.0f} MiB"]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="*", type=pathlib.Path)
    parser.add_argument("--triangles", default="1M")
    parser.add_argument("--forms", default=",".join(FORMS))
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--build", action="store_true", help="construction too")
    parser.add_argument("--temp-dir", help="where the files go, up to 300 bytes a triangle")
    arguments = parser.parse_args()
    reading, building = [], []
    with tempfile.TemporaryDirectory(dir=arguments.temp_dir) as name:
        folder = pathlib.Path(name)
        files = {path.name: path for path in arguments.files}
        for form in files or arguments.forms.split(","):
            path = files.get(form) or make(form, arguments.triangles, folder)
            reading.append(measure(form, path, arguments.repeat))
            if arguments.build:
                building.append(construction(form, path, folder))
            if not files:
                path.unlink()
    width = max(map(len, reading))
    print(common.table(["form", "size", "Pietra", "others: its processor time", ""][:width],
                       [row + [""] * (width - len(row)) for row in reading]))
    if building:
        print(common.table(["form", "triangles a core", "triangles", "peak memory"], building))


if __name__ == "__main__":
    main()
