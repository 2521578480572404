# SPDX-License-Identifier: Apache-2.0
"""Axes of plots: where values stand in pixels, and which of them are labelled without labels touching each other."""
import math

MOST = 9  # labels on an axis


def label(value):
    plain = value == 0 or 1e-3 <= abs(value) < 1e4
    return f"{value:g}" if plain else f"{value:.0e}".replace("e-0", "e-").replace("e+0", "e")


def multiples(low, high):
    """Lists of the multiples of 1, 2, 5 ... between."""
    decade = math.floor(math.log10(high - low)) - 1
    steps = [float(f"{m}e{d}") for d in (decade, decade + 1) for m in (1, 2, 5)]
    return [[float(f"{i * s:.9g}") for i in range(math.ceil(low / s - 1e-9), math.floor(high / s + 1e-9) + 1)]
            for s in steps]


def apart(axis, room, a, b):
    return abs(axis(b) - axis(a)) >= (room(a) + room(b)) / 2


class Round:
    """An axis whose labels are round values; `given`: values that were chosen, which are labelled instead."""

    given = None

    def labelled(self, room):
        """`room`: pixels along the axis that the label of a value takes."""
        if self.given:
            kept = []
            for v in self.given:
                if not kept or apart(self, room, kept[-1], v):
                    kept.append(v)
            return kept
        lists = [[v for v in values if self.low <= v <= self.high * (1 + 1e-9)] for values in self.rungs()]
        fitting = [values for values in lists if 2 <= len(values) <= MOST and
                   all(apart(self, room, a, b) for a, b in zip(values, values[1:]))]
        return max(fitting, key=len, default=[])

    def ticks(self, room=lambda value: 20):
        """(value, whether it is labelled)."""
        labelled = self.labelled(room)
        return [(v, v in labelled) for v in sorted({*labelled, *(self.given or self.between(labelled))})]


class Axis(Round):
    """Logarithmic, from `start` to `end` in pixels."""

    def __init__(self, values, start, end):
        self.low, self.high = min(values) / 1.15, max(values) * 1.15
        self.start, self.end = start, end

    def __call__(self, value):
        value = min(self.high, max(self.low, value))  # what lies beyond stands at the border
        return self.start + (self.end - self.start) * math.log(value / self.low) / math.log(self.high / self.low)

    def decades(self):
        return range(math.floor(math.log10(self.low)), math.ceil(math.log10(self.high)) + 1)

    def rungs(self):
        """Equal steps where there is little between the ends, else 1, 2, 5 of decades, else some decades."""
        fine = multiples(self.low, self.high) if self.high < 4 * self.low else []
        some = [[float(f"{m}e{d}") for d in self.decades() for m in ms]
                for ms in ((1, 2, 3, 4, 5, 6, 8), (1, 2, 5), (1, 3), (1,))]
        return fine + some + [[float(f"1e{d}") for d in self.decades() if d % n == 0] for n in (2, 3, 4)]

    def between(self, labelled):
        """Lines without a label: all of a decade, where there is room for them."""
        if self.high < 4 * self.low or abs(self(10 * self.low) - self(self.low)) < 80:
            return []
        inside = [float(f"{m}e{d}") for d in self.decades() for m in range(1, 10)]
        return [v for v in inside if self.low <= v <= self.high]


class Linear(Round):
    """From 0 to `high`, from `start` to `end` in pixels."""

    def __init__(self, high, start, end):
        self.low, self.high, self.start, self.end = 0.0, high, start, end

    def __call__(self, value):
        return self.start + (self.end - self.start) * min(value, self.high) / self.high

    def rungs(self):
        return multiples(self.low, self.high)

    def between(self, labelled):
        return []


def logarithmic(values, start, end):
    """Axis with room for markers and their names at the borders; what is not above 0 stands at the border."""
    values = [v for v in values if v > 0] or [1.0]
    room = (max(values) / min(values)) ** 0.04
    return Axis([min(values) / room, max(values) * room], start, end)


def from_zero(values, start, end):
    """Linear, where a plot wants it in place of a logarithmic axis."""
    return Linear(1.06 * max(values), start, end)


def chosen(values):
    """The values of a knob, if these are: few, and round as no measured ones are; else None."""
    found = sorted(set(values))
    return found if 2 <= len(found) <= MOST and all(float(f"{v:.3g}") == v for v in found) else None
