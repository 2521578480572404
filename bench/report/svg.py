# SPDX-License-Identifier: Apache-2.0
"""Plots as SVG text: axes, markers, lines, and labels beside what they name."""
import math
from xml.sax.saxutils import escape, quoteattr


def text(x, y, words, anchor="middle", more=""):
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{more}>{escape(words)}</text>'


def head(width, height, size=12):
    return (f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}" '
            f'font-family="sans-serif" font-size="{size}">\n<rect width="{width}" height="{height}" fill="#fff"/>')


def marker(x, y, shape, colour, faint, hollow=False):
    r = 2.5 if faint else 4.0
    looks = f'fill="{colour}" fill-opacity="{0.35 if faint else 1}"'
    if hollow:
        looks = f'fill="#fff" stroke="{colour}" stroke-width="1.8"'
    if shape == "circle":
        return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{r}" {looks}/>'
    if shape == "cross":
        path = f"M{x - r:.1f} {y - r:.1f}L{x + r:.1f} {y + r:.1f}M{x - r:.1f} {y + r:.1f}L{x + r:.1f} {y - r:.1f}"
        return f'<path d="{path}" stroke="{colour}" stroke-width="2" stroke-opacity="{0.35 if faint else 1}"/>'
    corners = {"square": [(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)],
               "up": [(0, -1.2), (1.1, 0.9), (-1.1, 0.9)], "down": [(0, 1.2), (1.1, -0.9), (-1.1, -0.9)],
               "diamond": [(0, -1.3), (1.3, 0), (0, 1.3), (-1.3, 0)]}[shape]
    path = "L".join(f"{x + r * u:.1f} {y + r * v:.1f}" for u, v in corners)
    return f'<path d="M{path}Z" {looks}/>'


def polyline(places, colour, more=' stroke-width="2"'):
    return f'<polyline points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in places)}" fill="none" stroke="{colour}"{more}/>'


class Axis:
    """Logarithmic, from `start` to `end` in pixels."""

    def __init__(self, values, start, end):
        self.low, self.high = min(values) / 1.15, max(values) * 1.15
        self.start, self.end = start, end

    def __call__(self, value):
        value = min(self.high, max(self.low, value))  # what lies beyond stands at the border
        return self.start + (self.end - self.start) * math.log(value / self.low) / math.log(self.high / self.low)

    def ticks(self):
        """(value, whether it is labelled): 1, 2, 5 of each decade where there are few decades, more within one."""
        decades = range(math.floor(math.log10(self.low)), math.ceil(math.log10(self.high)) + 1)
        span = math.log10(self.high / self.low)
        labelled = (1, 2, 3, 4, 5, 6, 8) if span < 1.0 else (1, 2, 5) if span < 3.0 else (1,)
        inside = [(float(f"{m}e{d}"), m in labelled) for d in decades for m in range(1, 10)]
        return [t for t in inside if self.low <= t[0] <= self.high]


class Linear:
    """From 0 to `high`, from `start` to `end` in pixels, with labels at 1, 2 or 5 of a decade, some five of them."""

    def __init__(self, high, start, end):
        self.low, self.high, self.start, self.end = 0.0, high, start, end

    def __call__(self, value):
        return self.start + (self.end - self.start) * min(value, self.high) / self.high

    def ticks(self):
        raw = self.high / 5
        decade = 10.0 ** math.floor(math.log10(raw))
        step = next(m * decade for m in (1, 2, 5, 10) if m * decade >= raw * 0.999)
        return [(i * step, True) for i in range(int(self.high / step * 1.0001) + 1)]


def from_zero(values, start, end):
    """Linear, where a plot wants it in place of Axis."""
    return Linear(max(values), start, end)


def label(value):
    plain = value == 0 or 1e-3 <= value < 1e4
    return f"{value:g}" if plain else f"{value:.0e}".replace("e-0", "e-").replace("e+0", "e")


def grid(x, y, box, x_label=label, y_label=label):
    """Lines at the ticks of both axes with their labels; `box`: left, right, top, bottom."""
    left, right, top, bottom = box
    parts = []
    for value, labelled in x.ticks():
        parts.append(f'<path d="M{x(value):.1f} {top}V{bottom}" stroke="{"#ccc" if labelled else "#eee"}"/>')
        if labelled:
            parts.append(text(x(value), bottom + 18, x_label(value), more=' class="axis"'))
    for value, labelled in y.ticks():
        parts.append(f'<path d="M{left} {y(value):.1f}H{right}" stroke="{"#ccc" if labelled else "#eee"}"/>')
        if labelled:
            parts.append(text(left - 8, y(value) + 4, y_label(value), "end", ' class="axis"'))
    return parts + [f'<path d="M{left} {top}V{bottom}H{right}V{top}Z" fill="none" stroke="#444"/>']


# --------------------------------------------------------------------------------------------------------------- plots

class Series:
    """`points`: (x, y, attributes of the marker, its tooltip), in the order in which they are joined."""

    def __init__(self, name, points, colour, shape, hollow=False, dashed=False):
        self.name, self.points, self.colour, self.shape = name, points, colour, shape
        self.hollow, self.dashed = hollow, dashed


def overlap(a, b):
    """Area that two boxes (x0, y0, x1, y1) share."""
    return max(0.0, min(a[2], b[2]) - max(a[0], b[0])) * max(0.0, min(a[3], b[3]) - max(a[1], b[1]))


def pieces(series):
    """Boxes of markers and of pieces of lines, and whose they are."""
    taken = []
    for s in series:
        for (x0, y0), (x1, y1) in zip(s.points, s.points[1:]):
            steps = max(1, int(math.hypot(x1 - x0, y1 - y0) / 8))
            taken += [((x0 + (x1 - x0) * i / steps - 2, y0 + (y1 - y0) * i / steps - 2, x0 + (x1 - x0) * i / steps + 2,
                        y0 + (y1 - y0) * i / steps + 2), s) for i in range(steps + 1)]
        taken += [((x - 6, y - 6, x + 6, y + 6), None) for x, y in s.points]
    return taken


def place_labels(series, box, size, placed):
    """(name, x, y, colour) of each: beside one of its points, where it covers least of what is there; `placed`: boxes
    of what else is written."""
    left, right, top, bottom = box
    taken, labels = pieces(series), []
    for s in series:
        width = 0.62 * size * len(s.name)
        best = None
        for rank, (x, y) in enumerate(s.points[::-1]):
            for dx, dy in ((9, 4), (9, -7), (9, 15), (-9 - width, 4), (-9 - width, -7), (-9 - width, 15),
                           (-width / 2, -11), (-width / 2, 20)):
                place = (x + dx, y + dy - 0.8 * size, x + dx + width, y + dy + 0.25 * size)
                outside = max(0, left + 2 - place[0]) + max(0, place[2] - right + 2) + max(0, top + 2 - place[1]) + \
                    max(0, place[3] - bottom + 2)
                cost = 60 * outside + 3 * rank + sum(6 * overlap(place, b) for b in placed) + \
                    sum(overlap(place, b) * (0.6 if owner is s else 1.5 if owner else 4.0) for b, owner in taken)
                if best is None or cost < best[0]:
                    best = (cost, x + dx, y + dy, place)
        labels.append((s.name, best[1], best[2], s.colour))
        placed.append(best[3])
    return labels


def padded(values):
    """With room for markers and their names at the borders."""
    room = (max(values) / min(values)) ** 0.04
    return [min(values) / room, max(values) * room]


class Plot:
    """Both axes logarithmic unless `x_axis` or `y_axis` is from_zero; series are labelled where they are."""

    def __init__(self, x_name, y_name, width=760, height=470, size=13, x_label=label, y_label=label, floor=None,
                 x_axis=Axis, y_axis=Axis):
        self.x_name, self.y_name, self.width, self.height, self.size = x_name, y_name, width, height, size
        self.x_label, self.y_label = x_label, y_label
        self.x_axis, self.y_axis = x_axis, y_axis
        self.floor = floor  # of x: points below stand at the border
        self.series, self.ringed, self.front = [], [], []
        self.horizontal, self.vertical = [], []  # (value, words)

    def box(self):
        return 62, self.width - 14, 46, self.height - 50

    def axes(self):
        left, right, top, bottom = self.box()
        points = [p for s in self.series for p in s.points]
        xs = [p[0] for p in points if p[0] > 0] + [v for v, _ in self.vertical]
        if self.floor:
            xs = [max(x, self.floor) for x in xs] or [self.floor, 1.0]
        ys = [p[1] for p in points if p[1] > 0] + [v for v, _ in self.horizontal]
        return self.x_axis(padded(xs or [1]), left, right), self.y_axis(padded(ys or [1]), bottom, top)

    def beside_lines(self, y, drawn):
        """Words of the horizontal lines, left, middle or right, above or below, where least is; and their boxes."""
        left, right, _, _ = self.box()
        taken, written, places = pieces(drawn), [], []
        for value, words in self.horizontal:
            width, options = 0.55 * self.size * len(words), []
            for at in (left + 6, (left + right - width) / 2, right - 6 - width):
                for down in (y(value) - 5, y(value) + self.size + 2):
                    place = (at, down - 0.8 * self.size, at + width, down + 0.25 * self.size)
                    cost = sum(overlap(place, b) for b, _ in taken) + sum(6 * overlap(place, b) for b in places)
                    options.append((cost, at, down, place))
            _, at, down, place = min(options, key=lambda o: o[0])
            written.append((words, at, down))
            places.append(place)
        return written, places

    def svg(self):
        x, y = self.axes()
        left, right, top, bottom = box = self.box()

        def at(value):
            return x(max(value, self.floor or value))

        parts = [head(self.width, self.height, self.size)] + grid(x, y, box, self.x_label, self.y_label)
        parts.append(text((left + right) / 2, self.height - 12, self.x_name, more=' class="axis"'))
        parts.append(text(8, top - 26, self.y_name, "start", ' class="axis" font-weight="bold"'))
        if self.front:  # a broad pale band below everything
            broad = ' stroke-width="13" stroke-linejoin="round" stroke-linecap="round" stroke-opacity="0.8"'
            parts.append(polyline([(at(a), y(b)) for a, b in self.front], "#ffe680", broad))
        for value, words in self.horizontal:
            parts.append(f'<path d="M{left} {y(value):.1f}H{right}" stroke="#222" stroke-dasharray="7 4"/>')
        for value, words in self.vertical:
            parts.append(f'<path d="M{x(value):.1f} {top}V{bottom}" stroke="#222" stroke-dasharray="2 4"/>')
            middle = min(x(value), self.width - 2 - 0.3 * self.size * len(words))
            parts.append(text(middle, top - 5, words, more=' class="axis"'))
        for s in self.series:
            dash = ' stroke-dasharray="5 4"' if s.dashed else ""
            parts.append(polyline([(at(p[0]), y(p[1])) for p in s.points], s.colour, f' stroke-width="2"{dash}'))
        for s in self.series:
            for p in s.points:
                said = f"<title>{escape(p[3])}</title>" if p[3] else ""
                attributes = "".join(f" {k}={quoteattr(str(v))}" for k, v in (p[2] or {}).items())
                drawn = marker(at(p[0]), y(p[1]), s.shape, s.colour, False, s.hollow)
                parts.append(f"<g{attributes}>{said}{drawn}</g>")
        drawn = [Series(s.name, [(at(p[0]), y(p[1])) for p in s.points], s.colour, s.shape)
                 for s in self.series if s.points]
        written, places = self.beside_lines(y, drawn)
        halo = ' stroke="#fff" stroke-width="3" paint-order="stroke"'
        parts += [text(across, down, words, "start", halo) for words, across, down in written]
        for words, across, down, colour in place_labels(drawn, box, self.size, places):
            parts.append(text(across, down, words, "start", f' fill="{colour}"{halo} font-weight="bold" class="name"'))
        return "\n".join(parts + ["</svg>", ""])
