"""The input image sequence, as Lee & Chen 1985 show theirs (Fig. A.1)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own.camera_model import LeeChenModel, ScaledOrthographicModel
from posekit.formats.own.result import Result
from posekit.formats.own.view import View
from posekit.skeleton import JOINTS
from posekit.viewer.plots.panels import panels, same_scale
from posekit.viewer.plots.plot_file import RIGHT_COLOUR, TRUNK_COLOUR, drawing
from posekit.viewer.plots.stick import add_key, draw_stick
from posekit.viewer.scene.drawn_subject import subject_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

Array = NDArray[np.float64]

SAME_POINT_DIGITS = 6
"""Digits after the point to which image points of several survivors are one."""


def plot_image(view: View, frames: Sequence[int] | None = None, *, result: Result | None = None) -> Figure:
    """Draw what the camera saw, a panel a frame.

    Parameters
    ----------
    view : View
        Image points in OpenCV's convention, y down; the drawing's y axis is turned over accordingly. Points
        of Lee & Chen's camera are drawn in the view's own unit, others in pixels, as wide as theirs are.
    frames : sequence of int, optional
        Which frames, from 0; all by default.
    result : Result, optional
        What was recovered: rings show where the camera projects its survivors, joints that were not seen included.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ViewerError
        Where matplotlib is missing, there are no frames or too many, or the result is of another view.
    """
    chosen = list(range(len(view)) if frames is None else frames)
    metric = isinstance(view.camera, LeeChenModel)
    scale = {"m": 1.0, "cm": 100.0, "mm": 1000.0}[view.unit] if metric else 1.0
    image = scale * view.image[chosen]
    head = scale * np.concatenate([view.head_image, view.own_head_image], axis=1)[chosen]
    again = [np.empty((0, 2))] * len(chosen) if result is None else _reprojected(view, result, chosen, scale)
    with drawing() as kind:
        figure, axes = panels(kind, len(chosen), columns=6, size=(1.5, 2.9), what="frames", sharey=True)
        extent = same_scale(axes, np.concatenate([image.reshape(-1, 2), head.reshape(-1, 2), *again]))
        axes[0].invert_yaxis()  # all share it
        for panel, frame, points, face, rings in zip(axes, chosen, image, head, again, strict=True):
            if isinstance(view.camera, ScaledOrthographicModel):
                panel.set_aspect(1 / view.camera.aspect)
            draw_stick(panel, points, extent=extent)
            panel.plot(*face.T, linestyle="none", marker=".", markersize=3.5, color=TRUNK_COLOUR, gid="head")
            if len(rings):
                panel.plot(
                    *rings.T, linestyle="none", marker="o", markersize=5.5, markerfacecolor="none",
                    markeredgecolor=RIGHT_COLOUR, markeredgewidth=0.8, gid="reprojected",
                )  # fmt: skip
            panel.set_title(f"frame {frame}, {view.time[frame]:.3g} s")
        figure.supxlabel(f"image x ({view.unit})" if metric else "image u (pixels)", fontsize=9)
        figure.supylabel(f"image y, down ({view.unit})" if metric else "image v, down (pixels)", fontsize=9)
        add_key(figure)
    return figure


def _reprojected(view: View, result: Result, frames: Sequence[int], scale: float) -> list[Array]:
    """Project all survivors of some frames, each at its own scale: (N * 14, 2) a frame."""
    found = []
    subject = subject_of(result, view)
    for k in frames:
        shown = subject.frames[k]
        if shown.sight is None or not len(shown):
            found.append(np.empty((0, 2)))
            continue
        sights = [shown.sight] * len(shown)
        if shown.scales is not None:
            sights = [shown.sight.rescaled(float(s)) for s in shown.scales]
        images = [
            sight.camera.project(points[None, : len(JOINTS)])[0]
            for sight, points in zip(sights, shown.points, strict=True)
        ]
        seen = scale * np.concatenate(images)
        found.append(np.unique(seen[np.isfinite(seen).all(axis=1)].round(SAME_POINT_DIGITS), axis=0))
    return found
