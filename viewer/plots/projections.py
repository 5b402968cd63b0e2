"""Survivors seen from the side, on the z_c y_c plane of the paper's camera frame (Figs. 6-8)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from posekit.errors import ViewerError
from posekit.skeleton import JOINTS, PARENTS
from posekit.viewer.plots.panels import panels, same_scale
from posekit.viewer.plots.plot_file import drawing
from posekit.viewer.plots.stick import add_key, draw_stick

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

APART_METRES = 0.03
"""Metres between two places of a joint from which each has its label."""

NAMES_A_LINE = 3
"""Joints named in a line of the title."""


def side_view(joints: Array, eye: float | None = None) -> Array:
    r"""Project postures onto the plane spanned by the camera's depth z_c and upward axis y_c.

    Without an eye, parallel: :math:`(z, -y)` of OpenCV's frame. With one, in perspective, as the paper's
    caption says without giving the eye: from a point on the line through the first posture's neck along x,
    `eye` metres from it, on the left of the camera's view,

    .. math:: (z_0 + d\,(z - z_0) / (d + x - x_0),\; -y_0 - d\,(y - y_0) / (d + x - x_0)).

    Parameters
    ----------
    joints : array (N, 14, 3)
        OpenCV camera frame (x right, y down, z forward), metres.
    eye : float, optional
        Distance d of the eye, metres.

    Returns
    -------
    array (N, 14, 2)
        Depth and height, metres. The paper's z_c is f less: its frame starts on the image plane.
    """
    if eye is None:
        flat: Array = joints[..., [2, 1]] * np.array([1.0, -1.0])
        return flat
    centre = joints[0, 0]
    distance = eye + joints[..., 0] - centre[0]
    nearest = float(np.nanmin(distance))
    if not nearest > 0.0:
        raise ViewerError(f"eye={eye:g} m is inside the figure; expected more than {eye - nearest:.2f} m")
    offset = (joints - centre)[..., [2, 1]] * (eye / distance)[..., None]
    projected: Array = (centre[[2, 1]] + offset) * np.array([1.0, -1.0])
    return projected


def plot_projections(
    joints: Array,
    *,
    superposed: bool = False,
    titles: Sequence[str] | None = None,
    eye: float | None = None,
) -> Figure:
    """Draw survivors of one frame from the side: the camera is on the left and looks to the right.

    Of an uncalibrated picture depth is relative: it counts from the root.

    Parameters
    ----------
    joints : array (N, 14, 3)
        Postures, OpenCV camera frame, metres; NaN where a joint is not known.
    superposed : bool
        All in one panel (Fig. 7), where two solutions of one joint are seen side by side, and labelled as there,
        instead of a panel each (Figs. 6 and 8).
    titles : sequence of N str, optional
        By default (a), (b), …, as in the paper.
    eye : float, optional
        Distance of the eye in metres, for a perspective view; see `side_view`.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ViewerError
        Where matplotlib is missing, there is no posture or too many for panels, or a shape is wrong.
    """
    joints = np.asarray(joints, dtype=np.float64)
    if joints.ndim != 3 or joints.shape[1:] != (len(JOINTS), 3):
        raise ViewerError(f"joints: got shape {joints.shape}; expected (N, 14, 3), metres")
    if not len(joints):
        raise ViewerError("joints: got no posture; expected at least one; was all rejected?")
    if titles is not None and len(titles) != len(joints):
        raise ViewerError(f"titles: got {len(titles)}; expected {len(joints)}, one a posture")
    points = side_view(joints, eye)
    with drawing() as kind:
        if superposed:
            figure, axes = panels(kind, 1, columns=1, size=(4.2, 4.6), what="panels")
            axes = [axes[0]] * len(joints)
        else:
            figure, axes = panels(
                kind, len(joints), columns=8, size=(1.45, 2.2), what="postures", sharey=True
            )
            for panel, title in zip(axes, titles or map(letter, range(len(joints))), strict=True):
                panel.set_title(title)
        extent = same_scale(axes, points)
        alpha = max(0.25, len(joints) ** -0.5) if superposed else 1.0
        for panel, posture in zip(axes, points, strict=True):
            draw_stick(panel, posture, extent=extent, alpha=alpha)
        if superposed:
            label_solutions(axes[0], points)
        # Nobody stands behind the centre of a camera: depth is then that of an uncalibrated picture.
        origin = "root" if bool((joints[..., 2] <= 0).any()) else "optical centre"
        figure.supxlabel(f"depth $z_c$ from the {origin} (m); the camera is to the left", fontsize=9)
        figure.supylabel("height $y_c$ (m)", fontsize=9)
        add_key(figure)
    return figure


def label_solutions(axes: Axes, points: Array) -> None:
    """Label joints (N, 14, 2) of several solutions, as Fig. 7 does: a1, a2, ..., b1; the title names the joints.

    A joint that is only carried along by the one before it has one solution. Labels that would overlap are one.
    """
    named: list[str] = []
    labels: list[tuple[str, Array, list[str]]] = []
    for joint, parent in enumerate(PARENTS[1:], start=1):
        offset = points[:, joint] - points[:, parent]
        firsts: list[int] = []
        for k in np.flatnonzero(~np.isnan(offset[:, 0])).tolist():
            if all(np.hypot(*(offset[k] - offset[other])) > APART_METRES for other in firsts):
                firsts.append(k)
        if len(firsts) < 2:
            continue
        key = letter(len(named)).strip("()")
        named.append(f"{key} {JOINTS[joint].replace('_', ' ')}")
        for number, k in enumerate(sorted(firsts, key=lambda row: float(offset[row, 0])), start=1):
            side, at = "left" if number == 1 else "right", points[k, joint]
            near = (one for one in labels if one[0] == side and np.hypot(*(one[1] - at)) < 2 * APART_METRES)
            label: tuple[str, Array, list[str]] = next(near, (side, at, []))
            label[2].append(f"{key}{number}")
            if len(label[2]) == 1:
                labels.append(label)
    for side, at, texts in labels:
        axes.annotate(
            " ".join(texts),
            (float(at[0]), float(at[1])),
            xytext=(-5 if side == "left" else 5, 0),
            textcoords="offset points",
            ha="right" if side == "left" else "left",
            va="center",
            fontsize=9,
            gid="solution",
        )
    lines = [", ".join(named[k : k + NAMES_A_LINE]) for k in range(0, len(named), NAMES_A_LINE)]
    axes.set_title("\n".join(lines), fontsize=8)


def letter(index: int) -> str:
    """Name a panel: (a) to (z), then (aa), (ab) and so on."""
    name = ""
    index += 1
    while index:
        index, rest = divmod(index - 1, 26)
        name = chr(ord("a") + rest) + name
    return f"({name})"
