# SPDX-License-Identifier: Apache-2.0
"""A figure of adaptive shadow testing over the tolerance, a curve for each certainty, as SVG text; both axes linear."""
import math

from convergence_plot import BOTTOM, HEIGHT, LEFT, RIGHT, TOP, WIDTH, marker, text

STYLES = {0: ("#444444", "cross"), 0.25: ("#0072b2", "square"), 0.5: ("#e69f00", "up"), 0.75: ("#009e73", "diamond"),
          1: ("#d55e00", "circle")}


def step_of(high):
    """Of the labels: 1, 2 or 5 of a decade, some five of them."""
    raw = high / 5
    decade = 10.0 ** math.floor(math.log10(raw))
    return next(m * decade for m in (1, 2, 5, 10) if m * decade >= raw * 0.999)


def plot(title, what, rows, column, bound):
    """`rows`: dictionaries with tolerance, certainty and `column`; `bound`: the tolerance is drawn as a line."""
    values = [r[column] for r in rows]
    right, bottom = WIDTH - RIGHT, HEIGHT - BOTTOM
    far, high = max(r["tolerance"] for r in rows) or 1.0, 1.05 * max(max(values), 1e-9)

    def x(v):
        return LEFT + (right - LEFT) * v / far

    def y(v):
        return bottom - (bottom - TOP) * min(v, high) / high

    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}" '
             'font-family="sans-serif" font-size="12">', f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>',
             text(WIDTH / 2, 24, title, more=' font-size="16"')]
    for axis, end in ((x, far), (y, high)):
        step = step_of(end)
        for i in range(int(end / step * 1.0001) + 1):
            at, label = axis(i * step), f"{round(i * step, 9):g}"
            across = axis is y
            parts.append(f'<path d="M{LEFT} {at:.1f}H{right}" stroke="#ccc"/>' if across else
                         f'<path d="M{at:.1f} {TOP}V{bottom}" stroke="#ccc"/>')
            parts.append(text(LEFT - 8, at + 4, label, "end") if across else text(at, bottom + 18, label))
    parts.append(f'<path d="M{LEFT} {TOP}V{bottom}H{right}V{TOP}Z" fill="none" stroke="#444"/>')
    parts.append(text((LEFT + right) / 2, HEIGHT - 12, "tolerance"))
    parts.append(text(LEFT, TOP - 10, what, "start"))
    if bound:
        end = min(far, high)
        parts.append(f'<path d="M{x(0):.1f} {y(0):.1f}L{x(end):.1f} {y(end):.1f}" stroke="#888" stroke-dasharray="6 4"/>')
    for i, (c, (colour, shape)) in enumerate(STYLES.items()):
        line = sorted((r["tolerance"], r[column]) for r in rows if r["certainty"] == c or r["tolerance"] == 0)
        if not any(r["certainty"] == c for r in rows):
            continue
        places = " ".join(f"{x(t):.1f},{y(v):.1f}" for t, v in line)
        parts.append(f'<polyline points="{places}" fill="none" stroke="{colour}" stroke-width="2"/>')
        parts += [marker(x(t), y(v), shape, colour, False) for t, v in line]
        at = TOP + 14 + 18 * i
        parts += [marker(right - 108, at, shape, colour, False), text(right - 96, at + 4, f"certainty {c:g}", "start")]
    return "\n".join(parts + ["</svg>", ""])
