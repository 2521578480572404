# SPDX-License-Identifier: Apache-2.0
"""Copies of .glb files with something changed in their JSON."""
import json
import struct


def read(path):
    """The scene as JSON gives it, and all that follows it in the file."""
    with open(path, "rb") as f:
        data = f.read()
    length, = struct.unpack_from("<I", data, 12)
    return json.loads(data[20:20 + length]), data[20 + length:]


def write(out, scene, rest):
    text = json.dumps(scene).encode()
    text += b" " * (-len(text) % 4)
    out.write(struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A) + text + rest)
    out.flush()
