"""The input image sequence, as Lee & Chen 1985 show theirs (Fig. A.1)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from posekit.files.camera_model import LeeChenModel
from posekit.files.view import View
from posekit.viewer.plots.figure import TRUNK, drawing
from posekit.viewer.plots.panels import panels, same_scale
from posekit.viewer.plots.stick import add_key, draw_stick

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure


def plot_image(view: View, frames: Sequence[int] | None = None) -> Figure:
    """Draw what the camera saw, a panel a frame.

    Parameters
    ----------
    view : View
        Image points in OpenCV's convention, y down; the drawing's y axis is turned over accordingly. Points
        of Lee & Chen's camera are drawn in the view's own unit, others in pixels.
    frames : sequence of int, optional
        Which frames, from 0; all by default.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ViewerError
        Where matplotlib is missing, or there are no frames or too many.
    """
    chosen = list(range(len(view)) if frames is None else frames)
    metric = isinstance(view.camera, LeeChenModel)
    scale = {"m": 1.0, "cm": 100.0, "mm": 1000.0}[view.unit] if metric else 1.0
    image = scale * view.image[chosen]
    head = scale * view.head_image[chosen]
    with drawing() as kind:
        figure, axes = panels(kind, len(chosen), columns=6, size=(1.5, 2.9), what="frames", sharey=True)
        extent = same_scale(axes, np.concatenate([image, head], axis=1))
        for panel, frame, points, face in zip(axes, chosen, image, head, strict=True):
            panel.invert_yaxis()
            draw_stick(panel, points, extent=extent)
            panel.plot(*face.T, linestyle="none", marker=".", markersize=3.5, color=TRUNK, gid="head")
            panel.set_title(f"frame {frame + 1}, {view.time[frame]:.3g} s")
        figure.supxlabel(f"image x ({view.unit})" if metric else "image u (pixels)", fontsize=9)
        figure.supylabel(f"image y, down ({view.unit})" if metric else "image v, down (pixels)", fontsize=9)
        add_key(figure)
    return figure
