"""One mesh in every form that Pietra reads, written here without Pietra."""
import json
import struct

TYPES = {"char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I",
         "float": "f", "double": "d"}


def ply(vertices, faces, form="binary_little_endian", real="float", count="uchar", index="int",
        extra=False, line="\n"):
    """`extra`: properties and elements that nobody asked for, before, between and after."""
    head = ["ply", f"format {form} 1.0", "comment made by a test"]
    if extra:
        head += ["element note 2", "property list uchar short words", "property int number"]
    head += [f"element vertex {len(vertices)}"]
    head += ["property list uchar uchar tags"] if extra else []  # one number would be a scalar
    head += [f"property {real} {axis}" for axis in "xyz"]
    head += [f"element face {len(faces)}"]
    head += ["property double quality"] if extra else []
    head += [f"property list {count} {index} vertex_indices"]
    head += ["property list int float weights"] if extra else []
    rows = []  # of (type, value)
    if extra:
        rows += [[("uchar", 2), ("short", -1), ("short", 7), ("int", 5)], [("uchar", 0), ("int", 6)]]
    rows += [([("uchar", 1), ("uchar", 9)] if extra else []) + [(real, x) for x in v] for v in vertices]
    rows += [([("double", 0.5)] if extra else []) + [(count, len(f))] + [(index, i) for i in f] +
             ([("int", 1), ("float", 2.5)] if extra else []) for f in faces]
    text = line.join(head + ["end_header"]).encode() + line.encode()
    if form == "ascii":
        return text + "".join(" ".join(repr(x) for _, x in row) + line for row in rows).encode()
    order = "<" if form == "binary_little_endian" else ">"
    return text + b"".join(struct.pack(order + TYPES[t], x) for row in rows for t, x in row)


def obj(vertices, faces, corner="{}", negative=False, line="\n", extra=False):
    """`corner`: what a corner of vertex {} looks like."""
    lines = ["# made by a test", "mtllib none.mtl", "o thing"] if extra else []
    lines += ["v " + " ".join(map(repr, v)) for v in vertices]
    lines += ["vt 0.5 0.5"] if "/1" in corner else []
    lines += ["g part", "usemtl red", "s off", ""] if extra else []
    for face in faces:
        numbers = [i - len(vertices) if negative else i + 1 for i in face]
        lines.append("f " + " ".join(corner.format(n) for n in numbers))
    return (line.join(lines) + line).encode()


def stl(vertices, faces, text=False):
    if text:
        facets = ["facet normal 0 0 0\n outer loop\n" +
                  "".join("  vertex " + " ".join(map(repr, vertices[i])) + "\n" for i in f) +
                  " endloop\nendfacet\n" for f in faces]
        return ("solid thing\n" + "".join(facets) + "endsolid thing\n").encode()
    data = b"made by a test".ljust(80) + struct.pack("<I", len(faces))
    for f in faces:
        data += struct.pack("<12fH", 0, 0, 0, *vertices[f[0]], *vertices[f[1]], *vertices[f[2]], 0)
    return data


def glb(vertices, faces, index="H", change=None):
    """`change`: what a test does to the JSON; bytes that it returns go behind the others."""
    positions = b"".join(struct.pack("<3f", *v) for v in vertices)
    indices = b"".join(struct.pack("<3" + index, *f) for f in faces)
    indices += bytes(-len(indices) % 4)
    low = [min(v[k] for v in vertices) for k in range(3)]
    high = [max(v[k] for v in vertices) for k in range(3)]
    scene = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": len(positions) + len(indices)}],
        "bufferViews": [{"buffer": 0, "byteLength": len(positions)},
                        {"buffer": 0, "byteOffset": len(positions), "byteLength": len(indices)}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": len(vertices),
                       "type": "VEC3", "min": low, "max": high},
                      {"bufferView": 1, "componentType": {"H": 5123, "I": 5125}[index],
                       "count": 3 * len(faces), "type": "SCALAR"}]}
    body = positions + indices
    if change:
        body += change(scene) or b""
    scene["buffers"][0]["byteLength"] = len(body)
    text = json.dumps(scene).encode()
    text += b" " * (-len(text) % 4)
    return (struct.pack("<III", 0x46546C67, 2, 28 + len(text) + len(body)) +
            struct.pack("<II", len(text), 0x4E4F534A) + text +
            struct.pack("<II", len(body), 0x004E4942) + body)


def coloured(kind, component, pack, values):
    """A change for glb(): every vertex of four has the COLOR_0 `values`."""
    def change(scene):
        data = b"".join(struct.pack(pack, *values) for _ in range(4))
        scene["bufferViews"].append({"buffer": 0, "byteOffset": scene["buffers"][0]["byteLength"],
                                     "byteLength": len(data)})
        scene["accessors"].append({"bufferView": 2, "componentType": component, "count": 4,
                                   "type": kind, "normalized": component != 5126})
        scene["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = 2
        return data + bytes(-len(data) % 4)
    return change
