#!/usr/bin/env python3
"""Compares the includes of src/ with the declared layers, and names the offenders.

usage: tools/check_layers.py [ROOT]        exit 0: all fine, else 1

The rules:
- The order of add_subdirectory() in CMakeLists.txt is the order of layers: a module may declare
  (add_module DEPENDS) only modules above it.
- A file may include headers of its own folder and of declared modules, by the path from src/.
- No method depends on another method (a folder in a method's own is of that method); runtime and render/ depend on no method.
"""

import re
import sys
from pathlib import Path

INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*"([^"]+)"', re.M)
SUBDIRECTORY = re.compile(r"^[ \t]*add_subdirectory\(([^)\s]+)", re.M)
MODULE = re.compile(r"^[ \t]*add_module\(([^)]*)\)", re.M)


class Module:
    def __init__(self, name, folder, depends):
        self.name, self.folder, self.depends = name, folder, depends


def folders_in_order(root):
    """Folders with a CMakeLists.txt below src/, in the order in which CMake visits them."""
    def visit(folder):
        lists = folder / "CMakeLists.txt"
        if not lists.is_file():
            sys.exit(f"check_layers: {lists} is missing")
        if folder != root:
            yield folder
        for name in SUBDIRECTORY.findall(lists.read_text()):
            if (folder / name).resolve().is_relative_to((root / "src").resolve()):
                yield from visit(folder / name)
    return list(visit(root))


def modules_in_order(root):
    modules = []
    for folder in folders_in_order(root):
        for arguments in MODULE.findall((folder / "CMakeLists.txt").read_text()):
            words = arguments.split()
            depends, key = [], None
            for word in words[1:]:
                if word in ("DEPENDS", "PACKAGES", "PROGRAM"):
                    key = word
                elif key == "DEPENDS":
                    depends.append(word)
            modules.append(Module(words[0], folder.relative_to(root / "src").as_posix(), depends))
    return modules


def method_of(module):
    return module.folder.split("/")[1]


def is_method(module):
    return module.folder.startswith("methods/")


def check_declarations(modules):
    faults, above = [], {}
    for module in modules:
        where = f"src/{module.folder}/CMakeLists.txt"
        for name in module.depends:
            other = above.get(name)
            if not other:
                faults.append(f"{where}: {module.name} depends on {name}, which is not above it")
            elif is_method(other) and is_method(module) and method_of(other) != method_of(module):
                faults.append(f"{where}: the method {module.name} depends on the method {name}")
            elif other.folder.startswith("methods") and re.match(r"(runtime|render)\b", module.folder):
                faults.append(f"{where}: {module.name} must not know methods, but depends on {name}")
        above[module.name] = module
    return faults


def check_includes(root, modules):
    faults, checked = [], 0
    by_folder = {module.folder: module for module in modules}
    for path in sorted((root / "src").rglob("*")):
        if path.suffix not in (".h", ".cpp"):
            continue
        folder = path.parent.relative_to(root / "src").as_posix()
        module = by_folder.get(folder)
        text = path.read_text()
        for match in INCLUDE.finditer(text):
            include, checked = match.group(1), checked + 1
            where = f"{path.relative_to(root)}:{text.count(chr(10), 0, match.start()) + 1}"
            target = Path(include).parent.as_posix()
            if not module:
                faults.append(f"{where}: the folder declares no module")
            elif target not in by_folder or not (root / "src" / include).is_file():
                faults.append(f'{where}: "{include}" is no header of src/ (others go in <>)')
            elif target != folder and by_folder[target].name not in module.depends:
                faults.append(f"{where}: {module.name} does not declare that it depends on "
                              f'{by_folder[target].name}, but includes "{include}"')
    return faults, checked


def main():
    root = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent.parent)
    modules = modules_in_order(root)
    if not modules:
        sys.exit("check_layers: no modules found")
    faults, checked = check_includes(root, modules)
    faults = check_declarations(modules) + faults
    for fault in faults:
        print(fault)
    print(f"check_layers: {len(modules)} modules, {checked} includes, {len(faults)} faults")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
