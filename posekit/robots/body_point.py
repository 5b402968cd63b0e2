"""Points of a model: a frame's origin, an offset in a frame, or a weighted mean of such places."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches

import pinocchio as pin

from posekit.errors import InputError


@dataclass(frozen=True, kw_only=True)
class BodySite:
    """A place on a body: a frame's origin, or an offset in that frame.

    Parameters
    ----------
    frame : str
        A link, a joint or another frame of the model.
    offset : tuple of 3 float
        Metres, in the frame.
    weight : float
        Its share in a mean of several sites, relative to the others'.
    """

    frame: str
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    weight: float = 1.0


@dataclass(frozen=True, kw_only=True)
class BodyPoint:
    """A named point of a model: one site, or the weighted mean of several."""

    name: str
    sites: tuple[BodySite, ...]


def body_points(frames: Sequence[str]) -> tuple[BodyPoint, ...]:
    """Make a point of each frame, named after it."""
    return tuple(BodyPoint(name=name, sites=(BodySite(frame=name),)) for name in frames)


def frame_index(model: pin.Model) -> dict[str, int]:
    """Return the frames by name; where a link and a joint share a name, the link."""
    index: dict[str, int] = {}
    for k in range(1, model.nframes):
        frame = model.frames[k]
        if frame.name not in index or frame.type == pin.FrameType.BODY:
            index[frame.name] = k
    return index


def find_frame(frames: dict[str, int], name: str, where: str) -> int:
    """Return a frame's index.

    Raises
    ------
    InputError
        Where there is no such frame; the nearest names are listed.
    """
    if name not in frames:
        near = get_close_matches(name, frames, n=3, cutoff=0.4) or list(frames)[:3]
        raise InputError(f"{where}: the model has no frame {name!r}; the nearest are {', '.join(near)}")
    return frames[name]
