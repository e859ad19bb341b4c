"""Whether the words of a figure can be read."""

import itertools

import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text


def words(figure: Figure) -> list[Text]:
    """Everything written that is seen: what matplotlib really draws."""
    found = []
    draw = Text.draw

    def noted(text: Text, renderer) -> None:
        if text.get_visible() and text.get_text().strip():
            found.append(text)
        draw(text, renderer)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Text, "draw", noted)
        figure.canvas.draw()
    return found


def assert_legible(figure: Figure) -> None:
    """No word is cut off, too small, or on top of another one."""
    renderer = figure.canvas.get_renderer()  # type: ignore[attr-defined]
    boxes = [(text, Text.get_window_extent(text, renderer)) for text in words(figure)]
    assert boxes
    page = figure.bbox
    for text, box in boxes:
        inside = box.x0 >= -1 and box.y0 >= -1 and box.x1 <= page.x1 + 1 and box.y1 <= page.y1 + 1
        assert inside, f"{text.get_text()!r} is cut off at {box}"
        assert float(text.get_fontsize()) >= 8
    for (one, box), (other, second) in itertools.combinations(boxes, 2):
        overlap = box.padded(-1).overlaps(second.padded(-1))
        assert not overlap, f"{one.get_text()!r} lies on {other.get_text()!r}"
