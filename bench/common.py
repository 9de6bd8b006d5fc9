"""What the benchmark scripts share: the program, inputs, temporary folders, tables."""
import gzip
import json
import math
import os
import pathlib
import shutil
import statistics
import subprocess

ROOT = pathlib.Path(__file__).resolve().parent.parent
SHARED = pathlib.Path(os.environ.get("PIETRA_SHARED", ROOT.parent / "shared"))
PIETRA = ROOT / "build/release/pietra"


def pietra(*arguments, check=True):
    """Runs the program quietly; the completed process."""
    run = subprocess.run([PIETRA, *map(str, arguments), "--progress", "none"], capture_output=True,
                         text=True)
    if check and run.returncode != 0:
        raise SystemExit(f"pietra {' '.join(map(str, arguments))}: exit {run.returncode}\n{run.stderr}")
    return run


def report(verb, *arguments, folder, wrap=()):
    """Runs a verb with --report and returns the report."""
    path = pathlib.Path(folder) / "report.json"
    command = [*wrap, PIETRA, verb, *map(str, arguments), "--force", "--progress", "none", "--report",
               path]
    run = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    if run.returncode != 0:
        raise SystemExit(f"{' '.join(map(str, command))}: exit {run.returncode}\n{run.stderr}")
    return json.loads(path.read_text())


def shared_mesh(name, folder):
    """Path of a mesh of the shared data, unpacked where it has to be; None where it is absent."""
    path = SHARED / "data" / name
    if not path.exists():
        return None
    if path.suffix != ".gz":
        return path
    plain = pathlib.Path(folder) / path.stem
    if not plain.exists():
        with gzip.open(path) as packed, open(plain, "wb") as out:
            shutil.copyfileobj(packed, out)
    return plain


def moon(folder, *arguments, name):
    """A PLY of the Moon's relief, made by the shared tool; None where that is absent."""
    source = SHARED / "tools/moon_to_ply.cpp"
    if not source.exists() or not shutil.which("djxl"):
        return None
    tool, out = pathlib.Path(folder) / "moon_to_ply", pathlib.Path(folder) / name
    if not tool.exists():
        subprocess.run(["g++", "-O2", "-std=c++20", "-o", tool, source], check=True)
    if not out.exists():
        subprocess.run([tool, SHARED / "data/moon", out, *map(str, arguments)], check=True,
                       stdout=subprocess.DEVNULL)
    return out


def median(values):
    return statistics.median(values)


def between(pairs, x):
    """y at x, both on logarithmic scales, among pairs (x, y); None beyond them."""
    pairs = sorted(pairs)
    for (x0, y0), (x1, y1) in zip(pairs, pairs[1:]):
        if x0 <= x <= x1 and x0 > 0:
            return y0 * (y1 / y0)**(math.log(x / x0) / math.log(x1 / x0) if x1 > x0 else 0)
    return None


def table(header, rows):
    """A Markdown table."""
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    lines += ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]
    return "\n".join(lines)
