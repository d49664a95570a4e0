"""Plots, where matplotlib is installed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ._native import GelFrame, Press, TactileError

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
