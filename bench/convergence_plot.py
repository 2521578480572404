# SPDX-License-Identifier: Apache-2.0
"""Curves of error over time as SVG text, both axes logarithmic."""
import math
from xml.sax.saxutils import escape

WIDTH, HEIGHT = 700, 460
LEFT, RIGHT, TOP, BOTTOM = 60, 16, 44, 52  # around the axes
# colours that differ in brightness as well (Okabe and Ito 2008), and shapes
STYLES = {"selection": ("#0072b2", "square"), "cache": ("#e69f00", "up"), "estimate": ("#d55e00", "circle"),
          "cached-selection": ("#009e73", "diamond"), "exact": ("#444444", "cross")}


def marker(x, y, shape, colour, faint):
    r = 2.5 if faint else 4.0
    looks = f'fill="{colour}" fill-opacity="{0.35 if faint else 1}"'
    if shape == "circle":
        return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{r}" {looks}/>'
    if shape == "cross":
        path = f"M{x - r:.1f} {y - r:.1f}L{x + r:.1f} {y + r:.1f}M{x - r:.1f} {y + r:.1f}L{x + r:.1f} {y - r:.1f}"
        return f'<path d="{path}" stroke="{colour}" stroke-width="2" stroke-opacity="{0.35 if faint else 1}"/>'
    corners = {"square": [(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)], "up": [(0, -1.2), (1.1, 0.9), (-1.1, 0.9)],
               "diamond": [(0, -1.3), (1.3, 0), (0, 1.3), (-1.3, 0)]}[shape]
    path = "L".join(f"{x + r * u:.1f} {y + r * v:.1f}" for u, v in corners)
    return f'<path d="M{path}Z" {looks}/>'


def text(x, y, words, anchor="middle", more=""):
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{more}>{escape(words)}</text>'


class Axis:
    """Logarithmic, from `start` to `end` in pixels."""

    def __init__(self, values, start, end):
        self.low, self.high = min(values) / 1.15, max(values) * 1.15
        self.start, self.end = start, end

    def __call__(self, value):
        return self.start + (self.end - self.start) * math.log(value / self.low) / math.log(self.high / self.low)

    def ticks(self):
        """(value, whether it is labelled): 1, 2, 5 of each decade where there are few decades."""
        decades = range(math.floor(math.log10(self.low)), math.ceil(math.log10(self.high)) + 1)
        labelled = (1, 2, 5) if math.log10(self.high / self.low) < 3.0 else (1,)
        inside = [(float(f"{m}e{d}"), m in labelled) for d in decades for m in range(1, 10)]
        return [t for t in inside if self.low <= t[0] <= self.high]


def label(value):
    return f"{value:g}" if 1e-3 <= value < 1e4 else f"{value:.0e}".replace("e-0", "e-").replace("e+0", "e")


def frame(x, y, title):
    left, right, top, bottom = LEFT, WIDTH - RIGHT, TOP, HEIGHT - BOTTOM
    parts = [text(WIDTH / 2, 24, title, more=' font-size="16"')]
    for value, labelled in x.ticks():
        parts.append(f'<path d="M{x(value):.1f} {top}V{bottom}" stroke="{"#ccc" if labelled else "#eee"}"/>')
        if labelled:
            parts.append(text(x(value), bottom + 18, label(value)))
    for value, labelled in y.ticks():
        parts.append(f'<path d="M{left} {y(value):.1f}H{right}" stroke="{"#ccc" if labelled else "#eee"}"/>')
        if labelled:
            parts.append(text(left - 8, y(value) + 4, label(value), "end"))
    parts.append(f'<path d="M{left} {top}V{bottom}H{right}V{top}Z" fill="none" stroke="#444"/>')
    parts.append(text((left + right) / 2, HEIGHT - 12, "seconds a frame"))
    parts.append(text(left, top - 10, "relMSE", "end"))
    return parts


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


def polyline(x, y, line, colour):
    places = " ".join(f"{x(p['frame_s']):.1f},{y(p['rel_mse']):.1f}" for p in line)
    return f'<polyline points="{places}" fill="none" stroke="{colour}" stroke-width="2"/>'


def plot(title, points, curves, floor):
    """`points`, `curves`: rows with frame_s and rel_mse by method; `floor`: the reference's own error, None: unknown."""
    drawn = {m: [p for p in points[m] if p["rel_mse"] > 0.0] for m in points}
    everything = [p for m in drawn for p in drawn[m]]
    head = (f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}" '
            'font-family="sans-serif" font-size="12">')
    parts = [head, f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>']
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
            parts.append(polyline(x, y, line, colour))
            parts += [marker(x(p["frame_s"]), y(p["rel_mse"]), shape, colour, False) for p in line]
        parts += legend(list(drawn))
    return "\n".join(parts + ["</svg>", ""])
