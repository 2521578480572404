# SPDX-License-Identifier: Apache-2.0
"""Where images are wrong: side by side under a slider, error and FLIP, the worst places enlarged."""
from report.methods import name_of
from report.page import figure, name, number, picture

TITLE = "How it looks"
STYLE = """<style>
.slider { position: relative; display: inline-block; --cut: 50%; line-height: 0; }
.slider img { width: 560px; height: auto; }
.slider .over { position: absolute; left: 0; top: 0; clip-path: inset(0 0 0 var(--cut)); }
.slider::after { content: ""; position: absolute; top: 0; bottom: 26px; left: var(--cut); border-left: 2px solid #fff;
                 box-shadow: 0 0 2px #000; }
.slider input { display: block; width: 100%; margin: 4px 0 0; height: 20px; }
.small img { width: 275px; height: auto; }
.zoom img { width: 118px; margin-right: 3px; image-rendering: pixelated; }
.zoom { margin: 8px 0 4px; } .small figure, .zoom figure { margin: 0; }
.small figcaption, .zoom figcaption { font-size: 0.82em; line-height: 1.35; }
</style>"""
SCRIPT = """<script>
document.querySelectorAll(".slider input").forEach(function (i) {
  i.addEventListener("input", function () { i.parentNode.style.setProperty("--cut", i.value + "%"); }); });
</script>"""


def shown(image, caption):
    return f"<figure>{image}<figcaption>{caption}</figcaption></figure>"


def zooms(a, row, prefix):
    out = []
    for i in range(len(row["figures"]["blocks"])):
        def of(field, form, i=i):
            return number(row, f"figures.blocks.{i}.{field}", form)
        images = "".join(picture(a, f"{prefix}-{i}-{what}.png", title) for what, title in (
            ("exact", "exact"), ("other", name_of(row)), ("flip", "FLIP")))
        where = f'at ({of("x", "plain")}, {of("y", "plain")}), FLIP {of("flip", "flip")}, l_inf ' \
                f'{of("l_inf", "percent")}, {of("share", "share")} of all differences'
        out.append(shown(f"<div>{images}</div>", where))
    return f'<div class="row zoom">{"".join(out)}</div>'


def at_which_speed(rows, row):
    """What the frame took, of the case of `curves` that made the image."""
    labels = row["labels"]
    made = rows.get(f'curves/{labels["scene"]}/{labels["method"]}/{labels["value"]:g}')
    return f" A frame is {number(made, 'point.frame', 'times')} as fast as exact, with " \
           f"{number(made, 'point.share', 'share')} of its shadow rays." if made and "point" in made else ""


def one(a, rows, row):
    scene, method = row["labels"]["scene"], name_of(row)
    prefix = f'pictures/{scene}-{row["labels"]["method"]}'
    exact, other, error, flip = (picture(a, f"{prefix}-{what}.png", title) for what, title in (
        ("exact", "exact"), ("other", method), ("error", "eight times the difference"), ("flip", "FLIP")))
    slider = f'<div class="slider">{exact}<span class="over">{other}</span><input type="range" min="0" max="100" ' \
             'value="50" aria-label="exact to the left, the method to the right"></div>'
    beside = shown(error, "eight times the difference: grey is alike") + \
        shown(flip, "FLIP: black is alike")
    caption = f"{name(scene)}: exact left of the line, {name(method)} right of it. Whole image, what is seen " \
              f"directly included: l_inf {number(row, 'figures.l_inf', 'percent')}, FLIP " \
              f"{number(row, 'figures.flip', 'flip')}, HDR-FLIP " \
              f"{number(row, 'figures.flip_hdr', 'flip')}.{at_which_speed(rows, row)}"
    inside = f'<div class="row">{slider}<div class="small">{beside}</div></div>{zooms(a, row, prefix)}'
    return f"<h3>{name(scene)}: {name(method)}</h3>" + figure(inside, caption, [row])


def section(a, rows):
    own = [r for r in rows.values() if r["labels"]["section"] == "pictures"]
    head = "<p>Left of the line exact, right of it a method; the slider moves the line. Beside it eight times the " \
           "difference, from grey (none) to red, and FLIP, how much of a difference one sees when the two are shown " \
           "by turns, from black (none) over red and yellow to white. Below, the three squares with the most FLIP: " \
           "exact, method, FLIP. The settings are neither equally fast nor equally wrong: each says how fast it is.</p>"
    return STYLE + head + "\n".join(one(a, rows, r) for r in own) + SCRIPT
