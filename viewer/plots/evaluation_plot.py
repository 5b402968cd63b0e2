"""Evaluations as charts: error over yaw, survivors over noise, correct poses over the threshold, reliability."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import ViewerError
from posekit.geometry import Array
from posekit.viewer.plots.plot_file import LEFT_COLOUR, MUTED_COLOUR, RIGHT_COLOUR, drawing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ROLE_LINES: Final[dict[str, Any]] = {"best": "-", "first": "--", "random": ":", "path": "-."}
ROLE_NAMES: Final = {"best": "best", "first": "ranked first", "random": "at random", "path": "path"}
PLOT_SIZE_INCHES: Final = (5.4, 3.6)


def plot_yaw(yaw: Array, errors: Mapping[float, Mapping[str, Array]]) -> Figure:
    """Draw mean errors over the camera's yaw, after Wang et al. 2014, Fig. 6.

    Parameters
    ----------
    yaw : array (Y,)
        Degrees; 0 is the frontal view.
    errors : mapping of float to mapping of str to array (Y,)
        By noise (px) and role (``best``, ``first``, ``random``, ``path``), mm; NaN where there is none.

    Raises
    ------
    ViewerError
        Where matplotlib is missing, or there is nothing to draw.
    """
    lines = [(noise, role, values) for noise, roles in errors.items() for role, values in roles.items()]
    _check(yaw, [values for _, _, values in lines], "yaws")
    with drawing() as kind:
        figure = kind(figsize=PLOT_SIZE_INCHES, layout="constrained")
        axes = figure.subplots()
        colours = _colours(list(errors))
        for noise, role, values in lines:
            axes.plot(yaw, values, ROLE_LINES[role], color=colours[noise], lw=1.3, gid=f"{noise:g} {role}")
        _style(axes, "yaw of the camera, degrees (0: frontal, 90: profile)", "mean MPJPE, mm")
        axes.set_xticks(np.arange(np.floor(yaw.min() / 45) * 45, yaw.max() + 1, 45))
        axes.set_ylim(bottom=0)
        _legend(figure, axes, colours, list(dict.fromkeys(role for _, role, _ in lines)))
    return figure


def plot_survivors(noise: Array, survivors: Mapping[str, Array], without: Array) -> Figure:
    """Draw how many survivors there are over the noise, and in how many views there is none.

    Parameters
    ----------
    noise : array (L,)
        Pixels.
    survivors : mapping of str to array (L,)
        By what is told of them, as ``median``.
    without : array (L,)
        Share of views without a survivor.

    Raises
    ------
    ViewerError
        Where matplotlib is missing, or there is nothing to draw.
    """
    _check(noise, [*survivors.values(), without], "levels of noise")
    with drawing() as kind:
        figure = kind(figsize=PLOT_SIZE_INCHES, layout="constrained")
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
        for name, line in zip(survivors, ("-", "--", ":", "-."), strict=False):
            upper.plot(
                noise, survivors[name], line, marker="o", ms=3.5, color=LEFT_COLOUR, lw=1.3, label=name
            )
        upper.set_yscale("symlog", linthresh=1)
        upper.set_ylim(bottom=0)
        _style(upper, "", "survivors")
        upper.legend()
        lower.plot(noise, 100 * without, marker="o", ms=3.5, color=RIGHT_COLOUR, lw=1.3)
        lower.set_ylim(0, 100)
        _style(lower, "standard deviation of image points, px", "views without, %")
    return figure


def plot_correct_poses(threshold: Array, share: Mapping[float, Mapping[str, Array]]) -> Figure:
    """Draw the share of correct poses over the threshold (Wandt et al. 2021, CVPR).

    Parameters
    ----------
    threshold : array (T,)
        Millimetres.
    share : mapping of float to mapping of str to array (T,)
        By noise (px) and role.

    Raises
    ------
    ViewerError
        Where matplotlib is missing, or there is nothing to draw.
    """
    lines = [(noise, role, values) for noise, roles in share.items() for role, values in roles.items()]
    _check(threshold, [values for _, _, values in lines], "thresholds")
    with drawing() as kind:
        figure = kind(figsize=PLOT_SIZE_INCHES, layout="constrained")
        axes = figure.subplots()
        colours = _colours(list(share))
        for noise, role, values in lines:
            axes.plot(
                threshold,
                100 * values,
                ROLE_LINES[role],
                color=colours[noise],
                lw=1.3,
                gid=f"{noise:g} {role}",
            )
        axes.set_xlim(float(threshold.min()), float(threshold.max()))
        axes.set_ylim(0, 101)
        _style(axes, "threshold of the worst joint, mm, after alignment", "correct poses, %")
        _legend(figure, axes, colours, list(dict.fromkeys(role for _, role, _ in lines)))
    return figure


def plot_reliability(
    probability: Array, share: Array, count: NDArray[Any], *, error: float, event: str
) -> Figure:
    """Draw how often what was said with some probability happened, and how often it was said.

    Parameters
    ----------
    probability, share : array (B,)
        Of each bin: the mean probability, and the share of events; NaN where it is empty.
    count : int array (B,)
        Frames of each bin.
    error : float
        The expected calibration error.
    event : str
        What the probability is of.

    Raises
    ------
    ViewerError
        Where matplotlib is missing, or there is nothing to draw.
    """
    _check(probability, [share, count], "bins")
    with drawing() as kind:
        figure = kind(figsize=(3.8, 4.2), layout="constrained")
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
        upper.plot([0, 1], [0, 1], color=MUTED_COLOUR, lw=0.9, linestyle=(0, (1, 2)), label="calibrated")
        upper.plot(probability, share, "o-", color=LEFT_COLOUR, ms=4.5, lw=1.2, label=f"ECE {error:.3f}")
        upper.set_xlim(0, 1)
        upper.set_ylim(0, 1)
        _style(upper, "", f"share with {event}")
        upper.legend()
        edges = np.arange(len(count)) / len(count)
        lower.bar(edges, count, width=1 / len(count), align="edge", color=MUTED_COLOUR)
        _style(lower, "probability of the survivor ranked first", "views")
    return figure


def _check(x: Array, lines: Sequence[NDArray[Any]], what: str) -> None:
    if not len(x) or not lines:
        raise ViewerError(f"no {what} to draw; expected one or more")
    for values in lines:
        if len(values) != len(x):
            raise ViewerError(f"{len(values)} values at {len(x)} {what}; expected one of each")


def _colours(levels: Sequence[float]) -> dict[float, str]:
    """Give each level a colour, the less noise the darker."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    places = np.linspace(0.0, 0.85, len(levels))
    return {level: to_hex(colormaps["viridis"](place)) for level, place in zip(levels, places, strict=True)}


def _style(axes: Axes, x: str, y: str) -> None:
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(visible=True)


def _legend(figure: Figure, axes: Axes, colours: Mapping[float, str], roles: Sequence[str]) -> None:
    """Say the noise by colour and the role by line, each once."""
    from matplotlib.lines import Line2D

    handles: list[Any] = [
        Line2D([], [], color=colour, label=f"{noise:g} px") for noise, colour in colours.items()
    ]
    handles += [
        Line2D([], [], color=MUTED_COLOUR, linestyle=ROLE_LINES[role], label=ROLE_NAMES[role])
        for role in roles
    ]
    figure.legend(handles=handles, loc="outside right center")
