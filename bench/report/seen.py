# SPDX-License-Identifier: Apache-2.0
"""What one sees where something is wrong, which option mends it, and what that costs: each with a picture."""
import dataclasses
import os

from report.page import FORMATS, figure, lookup, name, number, picture

TITLE = "What you see, which option, what it costs"


@dataclasses.dataclass
class Thing:
    id: str
    sees: str      # what is to be seen
    why: str
    scene: str
    setting: list
    before: list
    after: list
    exact: list = dataclasses.field(default_factory=list)  # lights of the image that is right, where these differ


def things(lights):
    """`lights`: virtual ones, and those of a sky."""
    punctual = ["--spp", "4", "--vpls", "0", "--light-samples", "0"]
    virtual = ["--spp", "4", "--vpls", str(lights), "--light-samples", "0"]
    sky = ["--env", "made/sun.hdr", "--vpls", "0"]
    cache = ["--visibility", "cache"]
    return [
        Thing("blocks", "shadows of lamps in blocks, thin ones gone", "cells far larger than a pixel",
              "conference-lights", punctual, [*cache, "--ce-delta", "32", "--refine", "1"],
              [*cache, "--ce-delta", "4", "--refine", "1"]),
        Thing("jaggies", "jagged edges of shadows", "cells of some pixels, not refined", "conference-lights", punctual,
              [*cache, "--ce-delta", "8", "--refine", "1"], [*cache, "--ce-delta", "8"]),
        Thing("steps", "soft shade of virtual lights in steps and squares",
              "cells too large for it; they save few rays, as pairs nearer than a cell are traced", "cornell", virtual,
              [*cache, "--ce", "48"], [*cache, "--ce", "8"]),
        Thing("samples", "penumbrae of area lights frayed and spotted",
              "a cell holds other points of the lamp for each eye sample", "cornell",
              ["--spp", "4", "--vpls", "0", "--light-samples", "16"], [*cache, "--ce-samples", "16"],
              [*cache, "--ce-samples", "0"]),
        Thing("noise", "noise in the estimate", "few rays a path", "cornell", virtual,
              ["--visibility", "estimate", "--select", "1"], ["--visibility", "estimate", "--select", "8"]),
        Thing("selection", "strong noise of selected lights", "drawn by brightness alone, as if all were seen",
              "cornell", virtual, ["--visibility", "exact", "--select", "4"],
              ["--visibility", "estimate", "--select", "4"]),
        Thing("stains", "faint shadows missing, flat stains", "adaptive testing leaves lights untested",
              "conference-lights", punctual, ["--visibility", "adaptive", "--tolerance", "0.5"],
              ["--visibility", "adaptive", "--tolerance", "0.05"]),
        Thing("grid", "tips of thin shadows missing", "the fastest mode of the grid finds them only where it looks",
              "dominoes", ["--spp", "1", *sky, "--env-lights", str(max(1, lights // 16))],
              ["--visibility", "grid=NEAR"], ["--visibility", "grid=SNB"]),
        Thing("banding", "wrong colours, dots and edges in indirect light", "few virtual lights", "cornell",
              ["--spp", "4", "--light-samples", "0"], ["--vpls", str(max(1, lights // 16))], ["--vpls", str(lights)],
              ["--vpls", str(16 * lights)]),
        Thing("sky", "many hard shadows side by side under a sky", "few lights stand for it", "shapes",
              ["--spp", "4", *sky], ["--env-lights", str(max(1, lights // 16))], ["--env-lights", str(lights)],
              ["--env-lights", str(4 * lights)])]


def options(words):
    """What is given on the command line, without what all of these have."""
    return " ".join(words).replace("--visibility ", "")


def difference(thing):
    """The options that the two do not share."""
    before, after = thing.before, thing.after
    kept = [w for w in before if w not in after] or before
    new = [w for w in after if w not in before]
    if not new:
        return f"default, without {options(kept)}"
    # a value alone is nothing without its option
    return options([w for i, w in enumerate(after) if w in new or (i + 1 < len(after) and after[i + 1] in new)])


def costs(thing, rows):
    """(head, field, format) of what is compared before and after."""
    if thing.exact:
        return [("seconds a frame", "figures.mode_run.frame_s", "seconds"),
                ("l_inf", "figures.reference.mode_run.l_inf", "percent")]
    return [("rays traced", "point.share", "share"), ("as fast as exact", "point.frame", "times"),
            ("l_inf", "point.error", "percent")]


def of_thing(rows, thing):
    return {w: rows.get(f"seeing/{thing.id}/{w}") for w in ("exact", "before", "after", "zoom")}


def one(a, rows, thing):
    own = of_thing(rows, thing)
    if not all(own.values()):
        return ""
    said = "; ".join(f'{head}: {number(own["before"], field, form)} &rarr; {number(own["after"], field, form)}'
                     for head, field, form in costs(thing, rows))
    said += f'; FLIP of the piece: {number(own["zoom"], "figures.strip.flip", "flip")} &rarr; ' \
            f'{number(own["zoom"], "figures.strip.better", "flip")}'
    strip = picture(a, f"pictures/seeing-{thing.id}-strip.png", thing.sees)
    caption = f"Left {name(options(thing.before))}, middle {name(options(thing.after))}, right how it should be. " \
              f"{thing.why[0].upper() + thing.why[1:]}. {said[0].upper() + said[1:]}."
    return f"<h3>{thing.sees}</h3>" + figure(strip, caption, list(own.values()))


def markdown(a, rows, all_things):
    """docs/seeing.md: the same as a table."""
    lines = ["# What you see, which option, what it costs", "",
             "Programs and options are those of `whitted`. This page and its pictures are made by", "",
             f"    ./report --only seeing --runs {a.level.runs} --out out/seeing",
             "    cp out/seeing/seeing.md docs/ && cp out/seeing/pictures/seeing-*-strip.png docs/pictures/", "",
             "Each picture: as it is, with the other option, as it should be; the worst third of "
             f"{a.level.seeing['size']} pixels by FLIP, enlarged.",
             f"Frames beside the exact one in the same run, one thread, pairs of frames: {a.level.runs}. `l_inf` as in "
             "[whitted.md](whitted.md#output);",
             "where virtual or sky lights are too few, against the image of many.",
             "", "| what you see | why | with | take | what it costs |", "| --- | --- | --- | --- | --- |"]
    for thing in all_things:
        own = of_thing(rows, thing)
        if not all(own.values()):
            continue
        cost = "; ".join(f'{head} {FORMATS[form](lookup(own["before"], field))} -> '
                         f'{FORMATS[form](lookup(own["after"], field))}' for head, field, form in costs(thing, rows))
        cost = cost.replace("l_inf", "`l_inf`")
        picture_of = f"![{thing.sees}](pictures/seeing-{thing.id}-strip.png)"
        lines += [f"| {thing.sees} {picture_of} | {thing.why} | `{options(thing.before)}` | `{difference(thing)}` " \
                  f"| {cost} |"]
    scenes = ", ".join(dict.fromkeys(f"`{t.scene}`" for t in all_things))
    lines += ["", "Not in the table: light that leaks where all grids have one orientation (`--cn 1`; in " \
              "`cornell` with `--ce 32` none",
              "was to be seen, the report counts such answers); corners that are darker than they should be, by " \
              "the clamp of virtual",
              "lights, which no option moves ([bdpt](bdpt.md) has none); flicker " \
              "([troubleshooting.md](troubleshooting.md)).",
              "", f"Scenes: {scenes}; the whole commands stand in the report's rows.", ""]
    with open(os.path.join(a.out, "seeing.md"), "w") as f:
        f.write("\n".join(lines))


def section(a, rows):
    all_things = things(a.level.seeing["lights"])
    markdown(a, rows, all_things)
    head = "<p>Settings so far from the defaults that what they do wrong is seen, and the option that mends it. Each " \
           "picture is the worst third of the image by FLIP, enlarged.</p>"
    return head + "\n".join(one(a, rows, t) for t in all_things)
