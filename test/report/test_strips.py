"""A tall figure is parted between its panels: nothing is lost, nothing is cut."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cam_rig.report.document import uris
from cam_rig.show.figure import empty, strips, styled, write, write_strip

DPI = 100


@styled
def stacked(rows: int):
    """Panels one above another, 1.5 inches each, with a title and a legend outside."""
    figure = empty(1.5 * rows + 0.6)
    for i, axes in enumerate(figure.subplots(rows, 1, squeeze=False)[:, 0]):
        axes.plot([0.0, 1.0], [0.0, i + 1.0], label=f"curve {i}")
        axes.set(ylabel="value", xlabel="x")
    figure.suptitle("A title")
    figure.legend(loc="outside lower center", ncols=4)
    return figure


def pixels(path: Path) -> np.ndarray:
    return np.asarray(Image.open(path).convert("L"), dtype=int)


@pytest.mark.variants(2)
@pytest.mark.parametrize("rows", [1, 12, 2, 5])
def test_strips_make_up_the_figure(rows: int, tmp_path: Path) -> None:
    """They lie on each other from the top to the foot, and each is as high as its panels need."""
    figure = stacked(rows)
    found = strips(figure)
    assert found[0][1] == figure.get_figheight() and found[-1][0] == 0.0
    assert [low for low, _ in found[:-1]] == [high for _, high in found[1:]]
    highest = max(high - low for low, high in found)
    assert highest < (4.0 if rows > 1 else 2.2)
    assert len(found) == 1 if rows == 1 else len(found) >= rows // 2


@pytest.mark.parametrize("rows", [1, 3])
def test_strips_show_what_the_figure_shows(rows: int, tmp_path: Path) -> None:
    """As much ink, to the rounding of the edges; cuts are through white alone."""
    figure = stacked(rows)
    parts = strips(figure)
    write(figure, tmp_path / "whole.png", DPI)
    whole, drawn = pixels(tmp_path / "whole.png"), []
    for low, high in parts:
        write_strip(figure, low, high, tmp_path / "a.png", DPI)
        drawn.append(pixels(tmp_path / "a.png"))
        assert drawn[-1].shape[0] == pytest.approx((high - low) * DPI, abs=1.0)
    ink = sum(int((255 - strip).sum()) for strip in drawn)
    assert ink == pytest.approx(int((255 - whole).sum()), rel=0.02)
    for low, _ in parts[:-1]:
        assert whole[whole.shape[0] - round(low * DPI)].min() == 255


def test_what_is_outside_is_not_in_the_file(tmp_path: Path) -> None:
    """Parts of a figure weigh about as much as all of it."""
    figure = stacked(4)
    sizes = []
    for low, high in strips(figure):
        write_strip(figure, low, high, tmp_path / "a.svg", None)
        sizes.append((tmp_path / "a.svg").stat().st_size)
    write(figure, tmp_path / "whole.svg")
    assert sum(sizes) < 1.5 * (tmp_path / "whole.svg").stat().st_size
    assert all(axes.get_visible() for axes in figure.axes)


def test_a_page_carries_the_strips():
    """As SVG in its text, the same bytes each time."""
    found = [uris(stacked(3)) for _ in range(2)]
    assert found[0] == found[1] and len(found[0]) == 2
    assert all(one.startswith("data:image/svg+xml;base64,") for one in found[0])
