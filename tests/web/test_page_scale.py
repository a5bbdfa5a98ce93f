"""The scale beside a curve, in the viewer's unit, as Debian's chromium computes it."""

from __future__ import annotations

from typing import Any

import pytest

from tests.support.chromium import chromium
from tests.support.pages import PageServer

pytestmark = pytest.mark.needs("chromium")

MARKS = "async (asked) => (await import('/static/units.js')).marks(...asked)"
"""The values of a scale with their words."""

DRAWN = """async ([unit, kept, width, minutes]) => {
    localStorage.setItem("lfs10d.unit", kept);
    const { draw, watch } = await import("/static/curve.js");
    const canvas = document.createElement("canvas"), texts = [];
    canvas.className = "tall";
    document.body.prepend(canvas);
    canvas.style.width = `${width}px`;
    const pen = canvas.getContext("2d"), write = pen.fillText.bind(pen);
    pen.fillText = (text, x, y) => { texts.push([text, x, y, pen.measureText(text).width]); write(text, x, y); };
    watch(canvas);
    const end = 1795298000 + 60 * minutes, points = [[end - 100, 60, 40, 100, 0]];
    draw(canvas, points, { end, span: 3600, unit, longest: 8, axis: true });
    await new Promise((done) => setTimeout(done, 500));
    canvas.remove();
    return texts;
}"""
"""The texts that a curve writes: each with where it stands, and how wide it is."""


def test_a_scale_has_round_numbers_of_the_viewers_unit_and_beaufort_its_own_numbers(server: PageServer) -> None:
    with chromium() as browser:
        page = browser.new_page()
        page.goto(server.address)

        def words(*asked: object) -> list[str]:
            return [each[1] for each in page.evaluate(MARKS, list(asked))]

        assert words(8.4, "m/s", "m/s") == ["0.0", "2.5", "5.0", "7.5"]
        assert words(8.4, "m/s", "km/h") == ["0.0", "10.0", "20.0", "30.0"]
        assert words(100.0, "m/s", "kn") == ["0.0", "50.0", "100.0", "150.0"]
        assert words(9.0, "m/s", "bft") == ["0", "1", "2", "3", "4", "5"]
        assert words(103.0, "m/s", "bft") == [str(force) for force in range(13)]
        assert words(40.0, "°C", "bft") == ["0", "10", "20", "30", "40"]


@pytest.mark.parametrize("kept", ["m/s", "bft"])
def test_no_text_of_a_scale_lies_over_another(server: PageServer, kept: str) -> None:
    with chromium() as browser:
        page = browser.new_page()
        page.goto(server.address)
        for minutes in range(10):
            texts: list[list[Any]] = page.evaluate(DRAWN, ["m/s", kept, 330, minutes])
            assert len(texts) >= 8
            for place, (_, x, y, width) in enumerate(texts):
                for _, other_x, other_y, other_width in texts[:place]:
                    apart = x >= other_x + other_width or other_x >= x + width or abs(y - other_y) >= 12
                    assert apart, texts
