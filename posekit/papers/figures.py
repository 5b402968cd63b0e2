"""Plots of the papers' figures: images and survivors of Lee & Chen's sequences; residual over the scale (Taylor)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from posekit.errors import ViewerError
from posekit.geometry import Array
from posekit.papers.lee_chen_walks import allowed, closest, count_walks, grown, representatives, sequence
from posekit.papers.taylor_objects import constrained_objects, scale_of
from posekit.recovery.objects import LinkageFamily, search
from posekit.skeleton import TREE_SEGMENTS
from posekit.synthesis.views import SEQUENCES


def draw_lee_chen(folder: Path, effort: str = "quick") -> list[Path]:
    """Draw Lee & Chen's Figures A.1 (images), 6 and 8 (one survivor per group in frame 1, from front and side).

    Parameters
    ----------
    folder : Path
        Existing folder.
    effort : str
        See `posekit.papers.reproduce`. The walker has the setting whose counts of survivors are closest to the printed
        counts.
    """
    paths = []
    setting = count_walks("seq1", effort).settings[closest(effort)]
    for name in SEQUENCES:
        view = sequence(name, setting)
        trees, head = grown(view.take([0]))
        joints = trees.joints[allowed(trees, head, (1, 2))]
        chosen = joints[representatives(joints)]
        figure = _figure(12, 9)
        axes = figure.subplots(3)
        _sticks(axes[0], view.image, "images, frames 1 to 5")
        _sticks(axes[1], chosen[..., [0, 1]], f"{len(chosen)} groups of frame 1, from the front")
        _sticks(axes[2], chosen[..., [2, 1]], "the same from the side")
        paths.append(folder / f"lee-chen.{name}.png")
        figure.savefig(paths[-1], dpi=100)
    return paths


def draw_taylor(folder: Path) -> list[Path]:
    """Draw Taylor's Figs. 7b and 8b: residual of the constraint over the scale, with the true signs of depths."""
    paths = []
    for one in constrained_objects():
        s = scale_of(one.points)
        family = LinkageFamily(linkage=one.linkage, image=one.points[:, :2] * s)
        found = search(family, {one.constraint: 1.0}, family.flips_of(one.points))
        figure, title = _figure(6, 4), f"{one.figure}b: {one.constraint}"
        axis = figure.subplots()
        axis.semilogy(found.curve_s / s, np.maximum(found.curve_residual, 1e-16))
        axis.set(xlim=(0.9, 3), xlabel="s / true s", ylabel="residual", title=title)
        paths.append(folder / f"taylor.{one.figure.lower().replace('. ', '')}.png")
        figure.savefig(paths[-1], dpi=100)
    return paths


def _sticks(axis: Any, postures: Array, title: str) -> None:
    """Draw stick figures (N, 14, 2), y down, side by side."""
    width = 1.2 * np.ptp(postures[..., 0], axis=1).max()
    for k, posture in enumerate(postures):
        segments = posture[np.array(TREE_SEGMENTS)] - posture[0] + [k * width, 0.0]
        axis.plot(*segments.T, "k-", linewidth=1)
    axis.set(aspect="equal", title=title)
    axis.invert_yaxis()
    axis.set_axis_off()


def _figure(width: float, height: float) -> Any:
    """Return an empty matplotlib figure; width and height are in inches."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise ViewerError(
            "pictures: matplotlib is not installed; expected matplotlib; pip install matplotlib"
        ) from None
    return Figure(figsize=(width, height), layout="constrained")
