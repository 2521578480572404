# SPDX-License-Identifier: Apache-2.0
"""A figure of adaptive shadow testing over the tolerance, a curve for each certainty, as SVG text; both axes linear."""
from convergence_plot import BOX, HEIGHT, LEFT, TOP, WIDTH
from report.axes import Linear
from report.svg import grid, head, marker, polyline, text

STYLES = {0: ("#444444", "cross"), 0.25: ("#0072b2", "square"), 0.5: ("#e69f00", "up"), 0.75: ("#009e73", "diamond"),
          1: ("#d55e00", "circle")}


def plot(title, what, rows, column, bound):
    """`rows`: dictionaries with tolerance, certainty and `column`; `bound`: the tolerance is drawn as a line."""
    values = [r[column] for r in rows]
    _, right, _, bottom = BOX
    x = Linear(max(r["tolerance"] for r in rows) or 1.0, LEFT, right)
    y = Linear(1.05 * max(max(values), 1e-9), bottom, TOP)

    def rounded(value):
        return f"{round(value, 9):g}"

    parts = [head(WIDTH, HEIGHT), text(WIDTH / 2, 24, title, more=' font-size="16"')]
    parts += grid(x, y, BOX, rounded, rounded)
    parts.append(text((LEFT + right) / 2, HEIGHT - 12, "tolerance"))
    parts.append(text(LEFT, TOP - 10, what, "start"))
    if bound:
        end = min(x.high, y.high)
        parts.append(f'<path d="M{x(0):.1f} {y(0):.1f}L{x(end):.1f} {y(end):.1f}" stroke="#888" stroke-dasharray="6 4"/>')
    for i, (c, (colour, shape)) in enumerate(STYLES.items()):
        line = sorted((r["tolerance"], r[column]) for r in rows if r["certainty"] == c or r["tolerance"] == 0)
        if not any(r["certainty"] == c for r in rows):
            continue
        parts.append(polyline([(x(t), y(v)) for t, v in line], colour))
        parts += [marker(x(t), y(v), shape, colour, False) for t, v in line]
        at = TOP + 14 + 18 * i
        parts += [marker(right - 108, at, shape, colour, False), text(right - 96, at + 4, f"certainty {c:g}", "start")]
    return "\n".join(parts + ["</svg>", ""])
