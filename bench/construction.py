#!/usr/bin/env python3
"""Construction of real meshes: rate, peak memory, temporary and output bytes a triangle.

Needs the shared data (PIETRA_SHARED or ../shared) and, for the Moon, djxl and g++. Inputs and models
go to --folder, some 10 GB for all. With --hard-limit the builds run in a memory cgroup of that size
(root, cgroup v1), page cache included."""
import argparse
import json
import os
import pathlib

import common

MESHES = {
    "turbine": lambda f: common.shared_mesh("scans/turbineblade.ply", f),
    "dragon": lambda f: common.shared_mesh("scans/dragon_vrip.ply.gz", f),
    "moon-2M": lambda f: common.moon(f, 0, 30, 10, 40, "--step", 8, name="moon-2M.ply"),
    "moon-13M": lambda f: common.moon(f, 0, 10, 10, 20, name="moon-13M.ply"),
    "moon-52M": lambda f: common.moon(f, 0, 20, 10, 30, name="moon-52M.ply"),
    "moon-118M": lambda f: common.moon(f, 0, 30, 10, 40, name="moon-118M.ply"),
    "moon-118M-shuffled": lambda f: common.moon(f, 0, 30, 10, 40, "--shuffle",
                                                name="moon-118M-shuffled.ply"),
}


def limited(size):
    """A command prefix that runs the rest in a memory cgroup."""
    group = pathlib.Path("/sys/fs/cgroup/memory/pietra-bench")
    group.mkdir(exist_ok=True)
    (group / "memory.limit_in_bytes").write_text(size)
    return ["sh", "-c", f"echo $$ > {group}/cgroup.procs && exec \"$@\"", "sh"]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--meshes", default="turbine,dragon,moon-2M,moon-13M")
    parser.add_argument("--jobs", default="1,2")
    parser.add_argument("--memory", default=None, help="passed on to pietra build")
    parser.add_argument("--hard-limit", default=None, help="size of the cgroup, as 576M")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--folder", default="bench-output")
    options = parser.parse_args()
    os.makedirs(options.folder, exist_ok=True)
    wrap = limited(options.hard_limit) if options.hard_limit else []
    results, rows = [], []
    for name in options.meshes.split(","):
        mesh = MESHES[name](options.folder)
        if mesh is None:
            print(f"{name}: the shared data is absent, left out")
            continue
        for jobs in options.jobs.split(","):
            extra = ["--memory", options.memory] if options.memory else []
            runs = [common.report("build", mesh, "-o", f"{options.folder}/{name}.pietra", "--jobs",
                                  jobs, *extra, folder=options.folder, wrap=wrap)
                    for _ in range(options.repeat)]
            triangles = runs[0]["input"]["triangles"]
            rate = common.median([r["triangles_per_second"] for r in runs])
            results.append({"mesh": name, "jobs": int(jobs), "runs": runs})
            rows.append([name, f"{triangles:,}", jobs, f"{rate / 1e3:,.0f} k/s",
                         f"{max(r['peak_rss_bytes'] for r in runs) / 2**20:,.0f} MiB",
                         f"{runs[0]['temp_bytes_peak'] / triangles:.1f}",
                         f"{runs[0]['output_bytes'] / triangles:.2f}"])
            print(" | ".join(rows[-1]), flush=True)
    pathlib.Path(options.folder, "construction.json").write_text(json.dumps(results, indent=1))
    print(common.table(["mesh", "triangles", "threads", "median rate", "peak memory",
                        "temporary B/triangle", "output B/triangle"], rows))


if __name__ == "__main__":
    main()
