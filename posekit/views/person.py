"""Whose body it is: the lengths that a user gives, in whichever way."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from posekit.body import Figure, load_figure
from posekit.body.anthropometry import (
    SegmentLengths,
    lengths_from_postures,
    lengths_from_proportions,
    lengths_from_views,
    read_lengths,
)
from posekit.body.closing import closing_line
from posekit.body.uncertainty import UNKNOWN_ADULT
from posekit.errors import InputError
from posekit.formats.format import Content
from posekit.formats.keypoints import KeyPoints, choose, read_keypoints, swap
from posekit.formats.motion import postures_of, read_motion
from posekit.formats.own import CameraModel, OpenCVModel
from posekit.formats.recognising import recognise
from posekit.formats.skeleton_maps import SkeletonMap, load_skeleton_map
from posekit.geometry import Array
from posekit.skeleton import JOINTS
from posekit.views.camera import in_pixels
from posekit.views.layout_offsets import between_key_points
from posekit.views.source import Source

BUILT_IN: Final = (
    "lengths of the built-in figure (Lee & Chen 1985, Table A.1), not this person's: give --stature"
)
UNKNOWN_PERSON_DEVIATION: Final = max(UNKNOWN_ADULT.own.values())
"""Relative standard deviation of the built-in figure's lengths, taken for a person of whom nothing is known."""

LEAST_DEVIATION: Final = 0.01
"""The least that estimated lengths are taken to be off: joints of a detector are not quite those of a skeleton."""

DEFAULT_PROPORTIONS: Final = "de-leva"
"""Of those that are built in the one whose ends are the joints' centres: key points are put beside those
(`posekit.views.layout_offsets`)."""


def person(
    source: Source, camera: CameraModel, layout: SkeletonMap, given: Path | None = None
) -> tuple[Figure, str, float | None]:
    """Make the person's figure, and say in a line where its lengths come from, and how far they may be off.

    The last is a relative standard deviation, None where nobody says.

    `given` is the file of the person: where it is the recording too, the same person of it is meant.

    Where the detector has no neck, the figure's is between its shoulders too (`middle_neck`): the two then mean the
    same point.

    Raises
    ------
    InputError, FigureError
        Where a file cannot be read, or what it says makes no body.
    """
    return figure_of(segment_lengths(source, camera, given, layout), layout)


def figure_of(lengths: SegmentLengths | None, layout: SkeletonMap) -> tuple[Figure, str, float | None]:
    """Make the figure of lengths, of which maybe nobody knows any, as `person` does."""
    figure, says = load_figure(), BUILT_IN
    deviation: float | None = UNKNOWN_PERSON_DEVIATION
    if lengths is not None:
        relative = [
            off / lengths.lengths[name] for name, off in lengths.deviation.items() if name in lengths.lengths
        ]
        deviation = max(float(np.median(relative)), LEAST_DEVIATION) if relative else None
        off = max(lengths.deviation.values(), default=0.0)
        uncertain = f", uncertain by up to {off * 100:.1f} cm" if off > 0 else ""
        figure = figure.scaled(lengths.lengths)
        says = "; ".join(
            filter(None, (f"lengths: {lengths.source}{uncertain}", closing_line(figure.moved_lengths)))
        )
    if "neck" not in layout.landmarks:
        figure = figure.scaled(middle_neck(figure.lengths))
    return figure, says, deviation


def middle_neck(lengths: Mapping[str, float]) -> dict[str, float]:
    r"""Return a figure's lengths with its neck in the middle between its shoulders.

    With shoulders w apart and c from the pelvis joint, the neck is w / 2 from each and :math:`\sqrt{c^2 - w^2 / 4}`
    from the pelvis joint; c is the mean of both sides, as a middle asks for.
    """
    half = lengths["right_shoulder-left_shoulder"] / 2
    to_pelvis = (lengths["right_shoulder-pelvis"] + lengths["left_shoulder-pelvis"]) / 2
    return {
        **lengths,
        "neck-right_shoulder": half,
        "neck-left_shoulder": half,
        "right_shoulder-pelvis": to_pelvis,
        "left_shoulder-pelvis": to_pelvis,
        "neck-pelvis": math.sqrt(to_pelvis**2 - half**2),
    }


def segment_lengths(
    source: Source, camera: CameraModel, given: Path | None = None, layout: SkeletonMap | None = None
) -> SegmentLengths | None:
    """Return the lengths that a source gives, in whichever way; None where nobody knows any. See `person`.

    Those of joint centres by a table are put between the key points of the `layout`.
    """
    if source.lengths is not None:
        read = read_lengths(source.lengths)
        if read.lengths or read.stature is None:
            return read
        source = replace(source, lengths=None, stature=source.stature or read.stature)
    if source.calibrate is not None:
        return _from_recording(source.calibrate, source, camera, given)
    if source.stature is None:
        return None
    name = DEFAULT_PROPORTIONS if source.proportions in ("figure", "taylor") else source.proportions
    found = lengths_from_proportions(name, source.stature)
    if layout is None or name != DEFAULT_PROPORTIONS:
        return found
    return between_key_points(found, source.stature, layout)


def _from_recording(path: Path, source: Source, camera: CameraModel, given: Path | None) -> SegmentLengths:
    """Estimate the lengths from motion capture, or from key points of the same kind of camera."""
    what = recognise(path)
    if what.holds is Content.MOTION:
        return lengths_from_postures(postures_of(read_motion(path)).joints).lengths
    if what.holds is not Content.KEY_POINTS:
        raise InputError(
            f"--calibrate: {path} is {what.holds.value}; expected motion capture or a detector's file of the same "
            "person; give another file"
        )
    if source.stature is None:
        raise InputError(
            "--calibrate: pictures tell proportions, not the size; expected a height too; give --stature"
        )
    same = given is not None and given.resolve() == path.resolve()
    found = in_pixels(
        read_keypoints(path, source.format or None if same else None, _map(source) if same else None),
        source.size,
    )
    if found.normalised:
        raise InputError(
            f"--calibrate: points of {path} are fractions of the picture, whose size is not known; expected pixels; "
            "give --size WIDTHxHEIGHT"
        )
    if same and source.swap_sides:
        found = swap(found)
    # A number is of the file that is to be recovered; in another the same number is somebody else.
    by_rule = not source.person.isdigit() and source.person not in ("", "all")
    one = choose(found, source.person if by_rule or (same and source.person.isdigit()) else "largest")
    focal = float(np.sqrt(camera.K[0, 0] * camera.K[1, 1])) if isinstance(camera, OpenCVModel) else None
    return lengths_from_views(limbs(one), stature=source.stature, focal=focal).lengths


def _map(source: Source) -> SkeletonMap | None:
    return load_skeleton_map(source.skeleton) if source.skeleton else None


def limbs(keypoints: KeyPoints) -> Array:
    """Return the twelve joints of arms and legs (T, 12, 2), in tree order without neck and pelvis."""
    columns = [k for k, name in enumerate(JOINTS) if name not in ("neck", "pelvis")]
    return keypoints.landmarks[:, columns]
