"""The kinds of defects that are put into clean clips: what names each rightly, its sizes, and where it can be."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from benchmarks import broken_clips as put
from benchmarks import broken_order
from benchmarks.broken_clips import Broken, Span
from posekit.validators.motion import MotionClip


@dataclass(frozen=True, kw_only=True)
class Defect:
    """A kind of defect.

    Parameters
    ----------
    name : str
        What tables call it.
    checks : tuple of str
        What names it rightly.
    unit : str
        Of its sizes.
    sizes : tuple of float
        From those that must be found, to where it fails.
    asked : float
        The least size that must be found.
    put : callable
        From clip, span, size and generator to the broken clip.
    frames : tuple of int
        The least and the most frames of its span; 0 means all of the clip.
    grounded : bool
        Whether a foot must stand in all frames of its span.
    rate : float
        Frames a second that a clip must have for it to be told.
    share : float
        Of a clip that may be wrong: what is off in most frames is what a clip usually has.
    """

    name: str
    checks: tuple[str, ...]
    unit: str
    sizes: tuple[float, ...]
    asked: float
    put: Callable[[MotionClip, Span, float, np.random.Generator], Broken | None]
    frames: tuple[int, int] = (15, 60)
    grounded: bool = False
    rate: float = 0.0
    share: float = 1.0


_ONE_FRAME: Final = (1, 1)
WHOLE: Final = (0, 0)
"""Frames of a span that is all of a clip."""
_ARM, _LEG = ("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle", "toe", "heel")

DEFECTS: Final[Mapping[str, Defect]] = {
    one.name: one
    for one in (
        Defect(
            name="floating",
            checks=("floating", "support"),
            unit="m",
            sizes=(0.1, 0.05, 0.03, 0.02, 0.01),
            asked=0.03,
            put=put.floating,
            grounded=True,
        ),
        Defect(
            name="sinking",
            checks=("penetration",),
            unit="m",
            sizes=(0.1, 0.05, 0.03, 0.02, 0.01),
            asked=0.03,
            put=put.sinking,
            grounded=True,
        ),
        Defect(
            name="floating clip",
            checks=("floating", "support"),
            unit="m",
            sizes=(0.1, 0.05, 0.03, 0.02, 0.01),
            asked=0.03,
            put=put.floating_clip,
            frames=WHOLE,
        ),
        Defect(
            name="sinking clip",
            checks=("penetration",),
            unit="m",
            sizes=(0.1, 0.05, 0.03, 0.02, 0.01),
            asked=0.03,
            put=put.sinking_clip,
            frames=WHOLE,
        ),
        Defect(
            name="sliding",
            checks=("sliding", "skating"),
            unit="m/s",
            sizes=(0.3, 0.1, 0.05, 0.03),
            asked=0.05,
            put=put.sliding,
            grounded=True,
        ),
        *(
            Defect(
                name=name,
                checks=("teleport",),
                unit="m",
                sizes=sizes,
                asked=asked,
                put=function,
                frames=frames,
            )
            for name, function, frames, sizes, asked in (
                ("jump of a joint", put.joint_jump, _ONE_FRAME, (0.3, 0.1, 0.05, 0.03), 0.1),
                ("jump of the body", put.body_jump, _ONE_FRAME, (0.3, 0.1, 0.05, 0.03), 0.1),
                ("step of the body", put.body_step, _ONE_FRAME, (0.3, 0.1, 0.05, 0.03), 0.1),
                ("step over frames", put.body_spread_step, (2, 5), (1.0, 0.5, 0.3, 0.2), 0.5),
            )
        ),
        *(
            Defect(
                name=f"swap of {what}",
                checks=("swap",),
                unit="",
                sizes=(1.0,),
                asked=1.0,
                put=put.swap(*parts),
                frames=(5, 100),
                share=share,
            )
            for what, parts, share in (
                ("both sides", (*_ARM, *_LEG, "eye", "ear"), 1.0),
                ("the arms", _ARM, 1.0),
                ("the legs", _LEG, 1.0),
                ("forearms", _ARM[1:], 0.6),
            )
        ),
        Defect(
            name="elbow beyond",
            checks=("joint-range",),
            unit="deg",
            sizes=(30.0, 10.0, 5.0),
            asked=10.0,
            put=put.bent("elbow", 150.0),
        ),
        Defect(
            name="knee beyond",
            checks=("joint-range",),
            unit="deg",
            sizes=(30.0, 10.0, 5.0),
            asked=10.0,
            put=put.bent("knee", 0.0),
        ),
        Defect(
            name="drift of a length",
            checks=("drift",),
            unit="1",
            sizes=(0.1, 0.05, 0.03, 0.02),
            asked=0.05,
            put=put.drift,
            share=0.35,
        ),
        Defect(
            name="jitter",
            checks=("jitter",),
            unit="m",
            sizes=(0.02, 0.01, 0.005, 0.003),
            asked=0.01,
            put=put.jitter,
            rate=25.0,
        ),
        Defect(
            name="jitter of a joint",
            checks=("jitter",),
            unit="m",
            sizes=(0.02, 0.01, 0.005, 0.003),
            asked=0.01,
            put=put.joint_jitter,
            rate=25.0,
        ),
        Defect(
            name="frozen",
            checks=("frozen",),
            unit="frames",
            sizes=(30.0, 15.0, 8.0),
            asked=8.0,
            put=broken_order.frozen,
            frames=(30, 30),
        ),
        Defect(
            name="repeated",
            checks=("repeated",),
            unit="frames",
            sizes=(2.0, 1.0),
            asked=1.0,
            put=broken_order.repeated,
            frames=_ONE_FRAME,
        ),
        Defect(
            name="missing",
            checks=("timing",),
            unit="frames",
            sizes=(10.0, 3.0, 1.0),
            asked=1.0,
            put=broken_order.missing,
            frames=(10, 10),
        ),
        Defect(
            name="out of order",
            checks=("timing",),
            unit="frames",
            sizes=(30.0, 10.0, 3.0),
            asked=3.0,
            put=broken_order.out_of_order,
            frames=(30, 30),
        ),
        Defect(
            name="shuffled",
            checks=("timing",),
            unit="m a frame",
            sizes=(0.05, 0.03, 0.02),
            asked=0.03,
            put=broken_order.shuffled,
        ),
        Defect(
            name="another unit",
            checks=("unit",),
            unit="times",
            sizes=(1000.0, 100.0, 39.37),
            asked=1.0,
            put=put.another_unit,
            frames=WHOLE,
        ),
        Defect(
            name="another up axis",
            checks=("up",),
            unit="deg",
            sizes=(180.0, 90.0),
            asked=90.0,
            put=put.another_up,
            frames=WHOLE,
        ),
    )
}
"""All kinds, by name."""
