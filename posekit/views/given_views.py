"""The views that a command is given: a view file's own, or those of people whom a detector saw, with their truth."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from posekit.display.plural import plural
from posekit.errors import InputError
from posekit.formats.format import Content
from posekit.formats.held_postures import POSTURE_CONTENTS
from posekit.formats.own import read_view
from posekit.formats.recognising import recognise
from posekit.skeleton import JOINT
from posekit.views.opened import Opened
from posekit.views.source import Source

OF_VIEWS: Final = ("--proportions", "--deviation")
"""Options that say something of a view too."""


def given_views(path: Path, source: Source, truth: Path | None = None) -> list[Opened]:
    """Open a view, or key points as views: one, or one a person.

    Parameters
    ----------
    path : Path
        A view file, or a file or folder of key points.
    source : Source
        How key points are to be read; a view says all of that itself.
    truth : Path, optional
        Motion capture of the same seconds.

    Raises
    ------
    InputError
        Where the file is neither, cannot be read, or the truth does not belong to it.
    """
    what = recognise(path, source.format)
    if what.holds is Content.VIEW:
        said = [name for name, given in source.given.items() if given and name not in OF_VIEWS]
        if said:
            raise InputError(
                f"{said[0]}: {path} is a view, which says camera, person and lengths itself; expected a detector's "
                "file; leave it out"
            )
        if source.proportions not in ("figure", "taylor"):
            raise InputError(
                f"--proportions: {source.proportions!r}; expected figure or taylor: a view says lengths itself"
            )
        opened = [Opened(person=0, view=read_view(path), says=())]
    elif what.holds is Content.KEY_POINTS:
        from posekit.views.opening import open_views

        if truth is not None and source.rate is None:
            from posekit.formats.motion import read_motion

            source = replace(source, rate=read_motion(truth).rate)
        opened = open_views(path, source)
    else:
        there = what.holds in POSTURE_CONTENTS
        remedy = f"its postures are there: posekit view {path}" if there else "give another file"
        raise InputError(
            f"{path}: {what.holds.value}; expected a view or key points, which a posture can be recovered from; "
            f"{remedy}"
        )
    if truth is None:
        return opened
    if len(opened) == 1:
        return [_with_truth(opened[0], truth)]
    return [_with_truth_if_theirs(one, truth) for one in opened]


def _with_truth_if_theirs(one: Opened, truth: Path) -> Opened:
    """Give one of several people the truth, where it is theirs."""
    try:
        return _with_truth(one, truth)
    except InputError as error:
        warnings.warn(f"person {one.person} has no truth: {error}", UserWarning, stacklevel=2)
        return one


def _with_truth(one: Opened, truth: Path) -> Opened:
    """Give a view the joints that its truth itself has: what would be derived is no truth."""
    from posekit.formats.motion import postures_of, read_motion
    from posekit.views.truth import with_truth

    motion = read_motion(truth)
    found = postures_of(motion)
    joints = found.joints.copy()
    joints[:, [JOINT[name] for name in found.derived]] = np.nan
    view, told = with_truth(one.view, joints, motion.time)
    says = (
        f"truth {motion.source}: {told.frames} of {plural(len(view), 'frame')}; its axes {told.turn} are the "
        "camera's world; it "
        f"misses the key points by {told.error:.1f} px (median)"
    )
    return replace(one, view=view, says=(*one.says, says))
