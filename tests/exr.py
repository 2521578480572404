# SPDX-License-Identifier: Apache-2.0
"""Reads layers of 32-bit floats out of EXR files as the renderers write them: scan lines, ZIP."""
import array
import struct
import sys
import zlib

FLOAT, ZIP, ROWS = 2, 3, 16  # kind of channel, kind of compression, scan lines of a chunk


def text(data, at):
    end = data.index(b"\0", at)
    return data[at:end].decode(), end + 1


def header(data):
    """Attributes by name, and where they end."""
    magic, version = struct.unpack_from("<II", data)
    if magic != 20000630 or version & ~0x4ff:
        raise ValueError("no scan lines of one part")
    at, attributes = 8, {}
    while data[at]:
        name, at = text(data, at)
        _, at = text(data, at)
        size = struct.unpack_from("<I", data, at)[0]
        attributes[name] = data[at + 4:at + 4 + size]
        at += 4 + size
    return attributes, at + 1


def channels(data):
    """Names in the order of the file."""
    at, names = 0, []
    while data[at]:
        name, at = text(data, at)
        if struct.unpack_from("<I", data, at)[0] != FLOAT:
            raise ValueError(f"{name}: no 32-bit floats")
        names.append(name)
        at += 16
    return names


def unzip(packed, size):
    if len(packed) == size:  # would have grown
        return packed
    halves, value = bytearray(zlib.decompress(packed)), 0
    for i, difference in enumerate(halves):  # each byte less the one before it, off by 128
        value = (value + difference - (128 if i else 0)) & 255
        halves[i] = value
    out, middle = bytearray(size), (size + 1) // 2
    out[::2], out[1::2] = halves[:middle], halves[middle:]
    return bytes(out)


def read(path):
    """(width, height, layers): each an array of floats, row by row."""
    with open(path, "rb") as f:
        data = f.read()
    attributes, at = header(data)
    if attributes["compression"] != bytes([ZIP]):
        raise ValueError("not ZIP")
    x0, y0, x1, y1 = struct.unpack("<4i", attributes["dataWindow"])
    width, height, names = x1 - x0 + 1, y1 - y0 + 1, channels(attributes["channels"])
    layers = {n: array.array("f") for n in names}
    for i in range((height + ROWS - 1) // ROWS):
        offset = struct.unpack_from("<Q", data, at + 8 * i)[0]
        y, size = struct.unpack_from("<iI", data, offset)
        rows = min(ROWS, y1 + 1 - y)
        chunk = array.array("f", unzip(data[offset + 8:offset + 8 + size], 4 * width * rows * len(names)))
        if sys.byteorder == "big":
            chunk.byteswap()
        for k in range(rows * len(names)):
            layers[names[k % len(names)]].extend(chunk[k * width:(k + 1) * width])
    return width, height, layers
