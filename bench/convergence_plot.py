# SPDX-License-Identifier: Apache-2.0
"""Curves of error over time as SVG text, both axes logarithmic."""
from report.axes import Axis
from report.svg import grid, head, marker, polyline, text

WIDTH, HEIGHT = 700, 460
LEFT, RIGHT, TOP, BOTTOM = 60, 16, 44, 52  # around the axes
BOX = LEFT, WIDTH - RIGHT, TOP, HEIGHT - BOTTOM
# colours that differ in brightness as well (Okabe and Ito 2008), and shapes
STYLES = {"selection": ("#0072b2", "square"), "cache": ("#e69f00", "up"), "estimate": ("#d55e00", "circle"),
          "cached-selection": ("#009e73", "diamond"), "exact": ("#444444", "cross")}


def frame(x, y, title):
    left, right, top, _ = BOX
    return [text(WIDTH / 2, 24, title, more=' font-size="16"')] + grid(x, y, BOX) + [
        text((left + right) / 2, HEIGHT - 12, "seconds a frame"), text(left, top - 10, "relMSE", "end")]


def legend(methods):
    left, top = WIDTH - RIGHT - 160, TOP + 10
    parts = [f'<path d="M{left} {top}h150v{18 * len(methods) + 8}h-150Z" fill="#fff" fill-opacity="0.85" stroke="#ccc"/>']
    for i, m in enumerate(methods):
        colour, shape = STYLES[m]
        y = top + 13 + 18 * i
        parts.append(f'<path d="M{left + 8} {y}h24" stroke="{colour}" stroke-width="2"/>')
        parts.append(marker(left + 20, y, shape, colour, False))
        parts.append(text(left + 40, y + 4, m, "start"))
    return parts


def plot(title, points, curves, floor):
    """`points`, `curves`: rows with frame_s and rel_mse by method; `floor`: the reference's own error, None: unknown."""
    drawn = {m: [p for p in points[m] if p["rel_mse"] > 0.0] for m in points}
    everything = [p for m in drawn for p in drawn[m]]
    parts = [head(WIDTH, HEIGHT)]
    if everything:
        x = Axis([p["frame_s"] for p in everything], LEFT, WIDTH - RIGHT)
        y = Axis([p["rel_mse"] for p in everything], HEIGHT - BOTTOM, TOP)
        parts += frame(x, y, title)
        if floor and y.low < floor < y.high:
            parts.append(f'<path d="M{LEFT} {y(floor):.1f}H{WIDTH - RIGHT}" stroke="#888" stroke-dasharray="6 4"/>')
            parts.append(text(LEFT + 6, y(floor) - 5, "the reference's own error, at most about", "start"))
        for m, rows in drawn.items():
            colour, shape = STYLES[m]
            line = [p for p in curves[m] if p["rel_mse"] > 0.0]
            parts += [marker(x(p["frame_s"]), y(p["rel_mse"]), shape, colour, True) for p in rows if p not in line]
            parts.append(polyline([(x(p["frame_s"]), y(p["rel_mse"])) for p in line], colour))
            parts += [marker(x(p["frame_s"]), y(p["rel_mse"]), shape, colour, False) for p in line]
        parts += legend(list(drawn))
    return "\n".join(parts + ["</svg>", ""])
