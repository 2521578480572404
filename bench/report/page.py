# SPDX-License-Identifier: Apache-2.0
"""Pieces of the page. Every number on it is taken out of a row and says out of which."""
import base64
import html
import os

FORMATS = {"percent": lambda v: f"{100 * v:.2f} %", "share": lambda v: f"{100 * v:.1f} %",
           "times": lambda v: f"{v:.2f}x" if v >= 0.095 else f"{v:.2g}x", "seconds": lambda v: f"{v:.3g} s",
           "count": lambda v: f"{v:,.0f}",
           "plain": lambda v: f"{v:g}" if isinstance(v, (int, float)) else str(v), "flip": lambda v: f"{v:.4f}",
           "error": lambda v: f"{v:.3g}", "pixels": lambda v: f"{v:.2f}"}
ESCAPE = html.escape


def lookup(row, field):
    """`field`: "figures.exact.frame_s"; None where it is not there."""
    for key in field.split("."):
        row = row.get(key) if isinstance(row, dict) else row[int(key)] if isinstance(row, list) else None
    return row


def number(row, field, form, bold=False):
    """A measured value as text that leads to its row; a dash where it is unknown."""
    value = lookup(row, field) if row else None
    if value is None:
        return "–"
    said = f'<data value="{ESCAPE(str(value))}" data-row="{ESCAPE(row["id"])}" data-field="{field}" ' \
           f'data-format="{form}">{ESCAPE(FORMATS[form](value))}</data>'
    return f"<b>{said}</b>" if bold else said


def given(words):
    """Numbers that were chosen, not measured: targets, and what papers say."""
    return f'<span class="given">{ESCAPE(words)}</span>'


def name(words):
    return f'<span class="name">{ESCAPE(words)}</span>'


def counted(row, field, what):
    """"1 path", "16 paths"."""
    return f'{number(row, field, "count")} {what}{"" if lookup(row, field) == 1 else "s"}'


def setting(row):
    """The image and the lights of a row."""
    parts = [f'{number(row, "figures.width", "plain")} x {number(row, "figures.height", "plain")} pixels',
             counted(row, "figures.spp", "path") + " a pixel"]
    if lookup(row, "figures.lights") is not None:
        parts.append(counted(row, "figures.lights", "light"))
    return ", ".join(parts + [counted(row, "figures.triangles", "triangle"), counted(row, "figures.threads", "thread")])


def attributes(row, **fields):
    """Of a marker in a plot: its row, and the fields that it stands for."""
    out = {"data-row": row["id"]}
    out.update({f"data-{k}": f"{f} {lookup(row, f)!r}" for k, f in fields.items()})
    return out


def table(columns, rows, known_as=None):
    """A column is (head, function of a row that gives HTML); `known_as`: by which documents ask for it."""
    of = f' id="{ESCAPE(known_as)}"' if known_as else ""
    lines = [f"<table{of}><thead><tr>" + "".join(f"<th>{h}</th>" for h, _ in columns) + "</tr></thead><tbody>"]
    lines += ["<tr>" + "".join(f"<td>{cell(r)}</td>" for _, cell in columns) + "</tr>" for r in rows]
    return "\n".join(lines + ["</tbody></table>"])


def commands(rows):
    """The command lines behind a figure."""
    lines = "\n".join(f'<tr><td class="name">{ESCAPE(r["id"])}</td><td><code>{ESCAPE(r["command"])}</code></td></tr>'
                      for r in rows)
    return f"<details><summary>commands and rows</summary><table>{lines}</table></details>"


def figure(inside, caption, rows):
    ids = ESCAPE(" ".join(r["id"] for r in rows))
    return f'<figure data-row="{ids}">{inside}<figcaption>{caption}</figcaption>{commands(rows)}</figure>'


def picture(a, path, title):
    """A PNG of the report's folder within the page."""
    try:
        with open(os.path.join(a.out, path), "rb") as f:
            data = base64.b64encode(f.read()).decode()
    except OSError:
        return f"<small>{ESCAPE(title)}: no picture</small>"
    return f'<img src="data:image/png;base64,{data}" alt="{ESCAPE(title)}" title="{ESCAPE(title)}">'


def save_plot(a, file_name, text):
    with open(os.path.join(a.out, "plots", file_name), "w") as f:
        f.write(text)
    return text


STYLE = """
body { font: 15px/1.5 sans-serif; max-width: 1180px; margin: 1.5em auto; padding: 0 1em; color: #1a1a1a;
       background: #fff; }
h1 { font-size: 1.7em; margin-bottom: 0.2em; } h2 { margin-top: 2.2em; border-bottom: 2px solid #ddd; }
h3 { margin-top: 1.8em; } ul.plain { list-style: none; padding-left: 0; }
figure { margin: 1em 0; } figcaption { color: #444; max-width: 62em; } details { color: #555; font-size: 0.85em; }
svg { max-width: 100%; height: auto; } .row { display: flex; flex-wrap: wrap; gap: 12px; align-items: flex-start; }
table { border-collapse: collapse; margin: 0.6em 0; }
th, td { padding: 3px 10px; border-bottom: 1px solid #ddd; text-align: left; }
th { background: #f3f3f3; font-weight: 600; } td b { background: #ffe680; padding: 1px 5px; border-radius: 3px; }
details table { display: block; max-height: 22em; overflow: auto; }
code { font-size: 0.92em; overflow-wrap: anywhere; }
td small, td data, .given { white-space: nowrap; } .lead { font-size: 1.12em; max-width: 58em; }
.loses { border-left: 5px solid #d55e00; padding-left: 0.8em; }
#headline td { white-space: nowrap; } #headline td, #headline th { padding: 2px 7px; } #headline h2 { margin-top: 1em; }
.wins { border-left: 5px solid #009e73; padding-left: 0.8em; } nav a { margin-right: 1.2em; }
"""


def page(a, sections):
    """`sections`: (anchor, title, HTML)."""
    links = "".join(f'<a href="#{anchor}">{ESCAPE(title)}</a>' for anchor, title, _ in sections)
    body = "\n".join(f'<section id="{anchor}"><h2>{ESCAPE(title)}</h2>\n{inside}</section>'
                     for anchor, title, inside in sections)
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>vcache: speed against error</title><style>{STYLE}</style></head><body>
<h1>vcache: speed against error</h1>
<nav>{links}</nav>
<p>How much faster a frame becomes by the visibility cache and by its rivals, and how wrong. Errors are against the
exact image of the same samples unless said otherwise: <code>l_inf</code> (so named by Popov et al., no maximum) is the
sum of absolute differences over the sum of the light that is shadow-tested. Exact traces every shadow ray, in the
fastest arrangement that we know; rays are given as shares of its rays. In plots of speed over error
<b>up and left is better</b>; yellow steps: the fastest that was measured at this error or less.</p>
{body}
<footer><h2>Where the numbers come from</h2>
<p>Each number was taken out of a row of <code>rows.json</code> (<code>rows.csv</code>) and names it: point at it. Below
each figure stand the commands. Machine: {given(a.machine)}. {given(a.written)}.
SCENES is the folder of <code>--scenes</code>; commands run in the report's folder.</p></footer>
<script>
document.querySelectorAll("data[data-row]").forEach(function (d) {{
  d.title = d.dataset.row + ": " + d.dataset.field + " = " + d.value; }});
</script></body></html>
"""
