"""Plots, which need matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ._native import GelFrame, Match, Press, StrainBetween, TactileError

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _figure(width: float) -> Figure:
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        sentence = "plots need matplotlib: pip install matplotlib"
        raise ImportError(sentence) from error
    return Figure(figsize=(width, 3.6), layout="constrained")


def plot_gel(frame: GelFrame) -> Figure:
    """See `GelFrame.plot`."""
    figure = _figure(5)
    axes = figure.subplots()
    drawn = axes.imshow(frame.depth * 1e3)
    figure.colorbar(drawn, label="depth (mm)")
    for contact in frame.contacts:
        axes.plot(*contact.outline.T, color="white")
    axes.set(xlabel="x (px)", ylabel="y (px)")
    return figure


def plot_match(found: Match) -> Figure:
    """See `Match.plot`."""
    figure = _figure(5)
    axes = figure.subplots()
    axes.plot(*found.target[:, :2].T, "o", mfc="none", color="tab:blue", label="target")
    axes.plot(*found.model[:, :2].T, ".", color="tab:orange", label="model")
    model, target = (points[rows, :2] for points, rows in zip((found.model, found.target), found.pairs.T))
    axes.plot(*np.stack([model, target]).transpose(2, 0, 1), color="tab:gray", lw=0.8)
    axes.set(xlabel="x", ylabel="y", title=f"{len(found.pairs)} pairs", aspect="equal")
    axes.legend()
    return figure


def plot_strain(found: StrainBetween, row: int = 0, column: int = 0) -> Figure:
    """See `StrainBetween.plot`."""
    figure = _figure(9)
    left, right = figure.subplots(1, 2)
    places = found.points if found.grid is None else found.grid.points
    source = found if found.grid is None else found.grid
    left.quiver(*places[:, :2].T, *source.displacements[:, :2].T, angles="xy", scale_units="xy", scale=1)
    left.set(xlabel="x", ylabel="y", title="displacement", aspect="equal")
    name = f"e_{'xyz'[row]}{'xyz'[column]}"
    drawn = right.scatter(*places[:, :2].T, c=source.strains[:, row, column])
    figure.colorbar(drawn, label=name)
    right.set(xlabel="x", ylabel="y", title="strain", aspect="equal")
    return figure


def plot_press(press: Press, frame: int = -1) -> Figure:
    """See `Press.plot`."""
    frame = frame + len(press) if frame < 0 else frame
    figure = _figure(9)
    left, right = figure.subplots(1, 2)
    left.imshow(press.image(frame), cmap="gray")
    left.set(title=f"frame {frame}", xlabel="x (px)", ylabel="y (px)")
    contact = press.contact(frame)
    if contact is not None:
        left.plot(contact.x.value, contact.y.value, "+", color="tab:orange")
    try:
        surface = press.surface(frame)
    except TactileError as error:
        right.set_axis_off()
        right.text(0.5, 0.5, str(error), ha="center", wrap=True)
        return figure
    rows, columns = surface.heights.shape
    (x, y), (width, height) = surface.origin, surface.pixel_size
    edges = [x, x + columns * width, y + rows * height, y]
    drawn = right.imshow(surface.heights * 1e3, extent=np.array(edges) * 1e3)
    figure.colorbar(drawn, label="height (mm)")
    right.set(title="surface", xlabel="x (mm)", ylabel="y (mm)")
    return figure
