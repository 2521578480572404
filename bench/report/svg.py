# SPDX-License-Identifier: Apache-2.0
"""Plots as SVG text: axes, markers, lines, and labels beside what they name."""
import math
from xml.sax.saxutils import escape, quoteattr

from report.axes import chosen, label, logarithmic


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
        width = 1 if hollow else 2
        return f'<path d="{path}" stroke="{colour}" stroke-width="{width}" stroke-opacity="{0.35 if faint else 1}"/>'
    corners = {"square": [(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)],
               "up": [(0, -1.2), (1.1, 0.9), (-1.1, 0.9)], "down": [(0, 1.2), (1.1, -0.9), (-1.1, -0.9)],
               "diamond": [(0, -1.3), (1.3, 0), (0, 1.3), (-1.3, 0)]}[shape]
    path = "L".join(f"{x + r * u:.1f} {y + r * v:.1f}" for u, v in corners)
    return f'<path d="M{path}Z" {looks}/>'


def told(attributes, words, drawn):
    """A marker with the row that it stands for, and what is said where one points at it."""
    given = "".join(f" {k}={quoteattr(str(v))}" for k, v in (attributes or {}).items())
    title = f"<title>{escape(words)}</title>" if words else ""
    return f"<g{given}>{title}{drawn}</g>"


def polyline(places, colour, more=' stroke-width="2"'):
    return f'<polyline points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in places)}" fill="none" stroke="{colour}"{more}/>'


def width_of(words, size):
    """About how wide words are, in pixels; bold ones."""
    return size * (0.62 * len(words) + 0.6)


def width_of_number(words, size):
    return size * sum({".": 0.32, ",": 0.32, " ": 0.32, "-": 0.36, "%": 0.95}.get(c, 0.64) for c in words)


def grid(x, y, box, x_label=label, y_label=label, size=12):
    """Lines at the ticks of both axes with their labels; `box`: left, right, top, bottom."""
    left, right, top, bottom = box
    parts = []
    for value, labelled in x.ticks(lambda v: width_of_number(x_label(v), size) + 0.4 * size):
        parts.append(f'<path d="M{x(value):.1f} {top}V{bottom}" stroke="{"#ccc" if labelled else "#eee"}"/>')
        if labelled:
            parts.append(text(x(value), bottom + 18, x_label(value), more=' class="axis"'))
    for value, labelled in y.ticks(lambda v: 1.7 * size):
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
    for s in sorted(series, key=lambda s: len(s.points)):  # first those that have least choice
        width = width_of(s.name, size)
        best = None
        for rank, (x, y) in enumerate(s.points[::-1]):
            for dx, dy in ((9, 4), (9, -7), (9, 15), (-9 - width, 4), (-9 - width, -7), (-9 - width, 15),
                           (-width / 2, -11), (-width / 2, 20), (9, -18), (9, 26), (-9 - width, -18), (-9 - width, 26)):
                place = (x + dx, y + dy - 0.8 * size, x + dx + width, y + dy + 0.25 * size)
                outside = max(0, left + 2 - place[0]) + max(0, place[2] - right + 2) + max(0, top + 2 - place[1]) + \
                    max(0, place[3] - bottom + 2)
                covered = sum(6 * overlap(place, b) for b in placed) + \
                    sum(overlap(place, b) * (0.6 if owner is s else 1.5 if owner else 4.0) for b, owner in taken)
                cost = 60 * outside + 3 * rank + 2 * max(0, abs(dy - 4) - 16) + covered
                if best is None or cost < best[0]:
                    best = (cost, x + dx, y + dy, place)
        labels.append((s.name, best[1], best[2], s.colour))
        placed.append(best[3])
    return labels


def spread(targets, gap, low, high):
    """Places near ascending targets, in their order and `gap` apart, between `low` and `high`."""
    groups = []  # [sum, count] of targets less what their order adds, where neighbours touch each other
    for i, t in enumerate(targets):
        groups.append([t - i * gap, 1])
        while len(groups) > 1 and groups[-2][0] * groups[-1][1] >= groups[-1][0] * groups[-2][1]:
            total, count = groups.pop()
            groups[-1] = [groups[-1][0] + total, groups[-1][1] + count]
    highest = high - (len(targets) - 1) * gap
    means = [min(max(low, total / count), highest) for total, count in groups for _ in range(count)]
    return [mean + i * gap for i, mean in enumerate(means)]


def steps(points):
    """What is reachable at an x or less: level from each point to the next one's x."""
    points = sorted(points)
    return points[:1] + [p for (_, y), (u, v) in zip(points, points[1:]) for p in ((u, y), (u, v))]


class Plot:
    """Both axes logarithmic unless `x_axis` or `y_axis` is from_zero; series are labelled where they are, or to the
    right where all end at the same value of a knob. Values of a knob are the labels of its axis."""

    def __init__(self, x_name, y_name, width=760, height=470, size=13, x_label=label, y_label=label, floor=None,
                 x_axis=logarithmic, y_axis=logarithmic):
        self.x_name, self.y_name, self.width, self.height, self.size = x_name, y_name, width, height, size
        self.x_label, self.y_label = x_label, y_label
        self.x_axis, self.y_axis = x_axis, y_axis
        self.floor = floor  # of x: points below stand at the border
        self.series, self.front = [], []
        self.horizontal, self.vertical = [], []  # (value, words)

    def knob(self):
        return chosen([p[0] for s in self.series for p in s.points])

    def named_at_the_end(self):
        """Whether all lines end at one value of a knob, beyond which there is room for their names."""
        last = (self.knob() or [None])[-1]
        return last is not None and all(len(s.points) > 1 and s.points[-1][0] == last for s in self.series)

    def frame(self):
        """Both axes, and the box that they leave: left, right, top, bottom."""
        top, bottom = 46, self.height - 50
        points = [p for s in self.series for p in s.points]
        xs, ys = ([p[i] for p in points] + [v for v, _ in of]
                  for i, of in enumerate((self.vertical, self.horizontal)))
        if self.floor:
            xs = [max(x, self.floor) for x in xs] or [self.floor, 1.0]
        y = self.y_axis(ys or [1.0], bottom, top)
        labels = [self.y_label(v) for v, labelled in y.ticks(lambda v: 1.7 * self.size) if labelled]
        left = max([width_of_number(words, self.size) for words in labels], default=0) + 16
        names = [width_of(s.name, self.size) for s in self.series] if self.named_at_the_end() else []
        right = self.width - max(names, default=-8) - 26
        x = self.x_axis(xs or [1.0], left, right)
        x.given = self.knob()
        return x, y, (left, right, top, bottom)

    def beside_lines(self, y, box, drawn):
        """Words of the horizontal lines, left, middle or right, above or below, where least is; and their boxes."""
        left, right, _, _ = box
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

    def end_labels(self, drawn, box, parts):
        """(name, x, y, colour) of each to the right of the plot; `parts` takes lines that lead there."""
        _, right, top, bottom = box
        drawn = sorted(drawn, key=lambda s: s.points[-1][1])
        places = spread([s.points[-1][1] for s in drawn], 1.25 * self.size, top, bottom)
        for s, place in zip(drawn, places):
            x, y = s.points[-1]
            parts.append(f'<path d="M{x + 7:.1f} {y:.1f}L{right:.1f} {y:.1f}L{right + 12:.1f} {place:.1f}" fill="none" '
                         f'stroke="{s.colour}" stroke-opacity="0.5"/>')
        return [(s.name, right + 15, place + 0.35 * self.size, s.colour) for s, place in zip(drawn, places)]

    def svg(self):
        x, y, box = self.frame()
        left, right, top, bottom = box

        def at(value):
            return x(max(value, self.floor or value))

        parts = [head(self.width, self.height, self.size)] + grid(x, y, box, self.x_label, self.y_label, self.size)
        parts.append(text((left + right) / 2, self.height - 12, self.x_name, more=' class="axis"'))
        parts.append(text(8, top - 26, self.y_name, "start", ' class="axis" font-weight="bold"'))
        if self.front:  # broad pale steps below everything
            broad = ' stroke-width="10" stroke-linejoin="round" stroke-linecap="round" stroke-opacity="0.8"'
            parts.append(polyline([(at(a), y(b)) for a, b in steps(self.front)], "#ffe680", broad))
        for value, words in self.horizontal:
            parts.append(f'<path d="M{left} {y(value):.1f}H{right}" stroke="#222" stroke-dasharray="7 4"/>')
        end = 0.0
        for value, words in sorted(self.vertical):
            parts.append(f'<path d="M{x(value):.1f} {top}V{bottom}" stroke="#222" stroke-dasharray="2 4"/>')
            half = width_of(words, self.size) / 2
            middle = min(max(x(value), end + half), self.width - 2 - half)  # beside the words of the line before
            parts.append(text(middle, top - 5, words, more=' class="axis"'))
            end = middle + half
        for s in self.series:
            dash = ' stroke-dasharray="5 4"' if s.dashed else ""
            parts.append(polyline([(at(p[0]), y(p[1])) for p in s.points], s.colour, f' stroke-width="2"{dash}'))
        for s in self.series:
            for p in s.points:
                parts.append(told(p[2], p[3], marker(at(p[0]), y(p[1]), s.shape, s.colour, False, s.hollow)))
        drawn = [Series(s.name, [(at(p[0]), y(p[1])) for p in s.points], s.colour, s.shape)
                 for s in self.series if s.points]
        written, places = self.beside_lines(y, box, drawn)
        halo = ' stroke="#fff" stroke-width="3" paint-order="stroke"'
        parts += [text(across, down, words, "start", halo) for words, across, down in written]
        if self.named_at_the_end():
            labels = self.end_labels(drawn, box, parts)
        else:
            labels = place_labels(drawn, box, self.size, places)
        for words, across, down, colour in labels:
            parts.append(text(across, down, words, "start", f' fill="{colour}"{halo} font-weight="bold" class="name"'))
        return "\n".join(parts + ["</svg>", ""])
