"""The colours of the report can be read by everybody (WCAG 2.2, AA)."""

import re

import pytest

from grader.machine import resources

TEXT = 4.5
GRAPHICS = 3.0
PAIRS = [
    *((name, ground, TEXT) for name in ("ink", "soft", "link") for ground in ("page", "card")),
    *((name, "card", TEXT) for name in ("passed", "failed", "skipped", "error")),
    *((name, "failed-tint", TEXT) for name in ("ink", "soft", "link", "failed")),
    *((name, "error-tint", TEXT) for name in ("ink", "error")),
    *((name, "code", TEXT) for name in ("ink", "soft")),
    *((name, "band", GRAPHICS) for name in ("data", "failed", "passed")),
    ("data", "code", GRAPHICS),
    ("skipped", "page", TEXT),
]


def themes():
    style = (resources.templates() / "report.css").read_text(encoding="utf-8")
    light, dark = re.findall(r":root \{([^}]*--page[^}]*)\}", style)
    colours = r"--([a-z-]+): (#[0-9a-f]{6});"
    return {"light": dict(re.findall(colours, light)), "dark": dict(re.findall(colours, dark))}


def luminance(colour):
    channels = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize(("front", "ground", "least"), PAIRS)
def test_every_text_has_enough_contrast(theme, front, ground, least):
    colours = themes()[theme]
    low, high = sorted([luminance(colours[front]), luminance(colours[ground])])
    assert (high + 0.05) / (low + 0.05) >= least


def test_both_themes_define_the_same_colours():
    found = themes()
    assert set(found["light"]) == set(found["dark"])
