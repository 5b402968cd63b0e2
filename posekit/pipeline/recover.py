"""One view in, every physically possible posture out."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.figure import Figure, load_figure
from posekit.files import View
from posekit.pipeline.camera_record import camera_records
from posekit.pipeline.fit_camera import CameraFit, fit_camera
from posekit.pipeline.recovery import Batch, FrameRecovery, Recovery
from posekit.pipeline.tolerance import EXACT, MEASURED, Tolerance
from posekit.skeleton import JOINT, JOINTS, PARENTS, RIGID_SEGMENTS, TREE_SEGMENTS, segment_name
from posekit.tree import Check, InterpretationTree
from posekit.validators import PHYSICAL, Ranges, check_names, load_ranges, make_checks
from posekit.validators.walking import DEFAULT_RULES

FRAMES_AT_ONCE = 250
"""Frames grown together: enough to spread NumPy's overhead, few enough to stay in the cache."""


def recover(
    view: View,
    *,
    figure: Figure | None = None,
    checks: Sequence[str] = PHYSICAL,
    ranges: str | Ranges = "urdf",
    rules: Sequence[int] = DEFAULT_RULES,
    tolerance: Tolerance | None = None,
    contact_margin: float = 0.0,
    group: float | None = None,
    progress: Callable[[int], None] | None = None,
) -> Recovery:
    """Recover every posture behind a view that passes the checks.

    Parameters
    ----------
    view : View
    figure : Figure, optional
        The built-in one if not given; the view's own lengths, stature and head points are applied to it.
    checks : sequence of str
        Some of ``rigid-parts``, ``joint-range``, ``collision``, ``walking``.
    ranges : str or Ranges
        ``urdf``, ``table1``, the path of a TOML table, or ranges.
    rules : sequence of int
        Rules of walking, used where ``walking`` is among the checks.
    tolerance : Tolerance, optional
        By default each frame is judged as exact where distances inside torso or hips show that it is, else as
        measured.
    contact_margin : float
        Metres that bodies must keep from each other; negative allows penetration.
    group : float, optional
        Metres within which similar survivors are grouped.
    progress : callable, optional
        Called with the number of frames done since the last call.

    Returns
    -------
    Recovery

    Raises
    ------
    PosekitError
        Where the view cannot be what it says: no neck in any frame, a segment too short for its image.

    Examples
    --------
    >>> import posekit
    >>> recovery = posekit.recover(posekit.builtin_view("seq1"))
    >>> len(recovery.frames)
    5
    """
    names = check_names(checks)
    if group is not None and not (math.isfinite(group) and group >= 0):
        raise InputError(f"--group: {group!r} m; expected zero or a positive length")
    table = load_ranges(ranges) if isinstance(ranges, str) else ranges
    person = person_of(view, figure or load_figure())
    fit = fit_camera(view, person)
    records = camera_records(view, fit)
    grower = _Grower(
        view=view,
        fit=fit,
        figure=person,
        checks=names,
        ranges=table,
        rules=tuple(rules),
        contact_margin=contact_margin,
    )
    placed: dict[int, tuple[Batch | None, int]] = {}
    usable = np.flatnonzero([not reason for reason in fit.reasons])
    for first in range(0, len(usable), FRAMES_AT_ONCE):
        chosen = usable[first : first + FRAMES_AT_ONCE]
        batch = grower.grow(chosen, tolerance or EXACT)
        placed |= {int(k): (batch, index) for index, k in enumerate(chosen)}
        inexact = chosen[~_is_exact(batch)] if tolerance is None else chosen[:0]
        if len(inexact):
            again = grower.grow(inexact, MEASURED)
            placed |= {int(k): (again, index) for index, k in enumerate(inexact)}
        if progress is not None:
            progress(len(chosen))
    frames = []
    for k, time in enumerate(view.time.tolist()):
        grown, index = placed.get(k, (None, 0))
        frames.append(
            FrameRecovery(
                time=time,
                batch=grown,
                index=index,
                reason=fit.reasons[k],
                group_within=group,
                camera=records[k],
            )
        )
    _refuse_impossible(frames)
    settings = {
        "checks": list(names),
        "ranges": table.name,
        "range_limits": {where: list(bounds) for where, bounds in table.limits.items()},
        "rules": list(rules) if "walking" in names else [],
        "tolerance": "exact, else measured" if tolerance is None else asdict(tolerance),
        "exact": asdict(EXACT),
        "measured": asdict(MEASURED),
        "contact_margin": contact_margin,
        "group": group,
        "figure": person.hash,
        "lengths": dict(person.lengths),
        "judged": [frame.judged for frame in frames],
        "versions": {name: version(name) for name in ("posekit", "pin", "coal", "numpy")},
    }
    return Recovery(figure=person, fit=fit, frames=frames, settings=settings)


def person_of(view: View, figure: Figure) -> Figure:
    """Apply a view's own stature, lengths and head points to a figure."""
    if view.stature is not None:
        figure = figure.from_stature(view.stature)
    if view.lengths or view.head_points:
        figure = figure.scaled(view.lengths, view.head_points)
    return figure


@dataclass(frozen=True, kw_only=True, eq=False)
class _Grower:
    """Grows trees over some frames of one view with one tolerance."""

    view: View
    fit: CameraFit
    figure: Figure
    checks: tuple[str, ...]
    ranges: Ranges
    rules: tuple[int, ...]
    contact_margin: float

    @cached_property
    def tree(self) -> InterpretationTree:
        lengths = [0.0, *(self.figure.lengths[segment_name(segment)] for segment in TREE_SEGMENTS)]
        return InterpretationTree(joints=JOINTS, parents=PARENTS, lengths=np.array(lengths))

    def suite(self, tolerance: Tolerance, *, exact: bool = False) -> list[Check]:
        """Return the checks, made once, with every distance measured where their margins are wanted."""
        if (tolerance, exact) not in self._suites:
            self._suites[tolerance, exact] = self._make_suite(tolerance, exact)
        return self._suites[tolerance, exact]

    def _make_suite(self, tolerance: Tolerance, exact: bool) -> list[Check]:
        return make_checks(
            self.figure,
            self.checks,
            ranges=self.ranges,
            rigid_tolerance=tolerance.rigid,
            rigid_mode="placement" if tolerance.placement else "distances",
            angle_tolerance=tolerance.angle,
            rules=self.rules,
            contact_margin=self.contact_margin,
            exact=exact,
        )

    @cached_property
    def _suites(self) -> dict[tuple[Tolerance, bool], list[Check]]:
        return {}

    def grow(self, frames: NDArray[np.intp], tolerance: Tolerance) -> Batch:
        """Grow the trees of some frames: physical checks on the way, the motion model on the leaves."""
        suite = self.suite(tolerance)
        camera = self.fit.frames(frames)
        with np.errstate(over="ignore"):  # nothing reaches the ray of an image point at 1e300
            leaves = self.tree.grow(
                camera,
                self.fit.root[frames],
                self.view.image[frames],
                [check for check in suite if check.name != "walking"],
                given=self.fit.head[frames],
                tolerance=tolerance.tangent,
            )
        physical = leaves.counts()
        leaves = self.tree.prune(leaves, [check for check in suite if check.name == "walking"])
        return Batch(
            leaves=leaves,
            physical=physical,
            checks=self.suite(tolerance, exact=True),
            figure=self.figure,
            tolerance=tolerance,
        )


def _is_exact(batch: Batch) -> NDArray[np.bool_]:
    """Find frames (F,) whose image points are exact: there is evidence that rounding is all that is off.

    Four distances inside torso and hips are not used to lift anything. That they come out right to 1e-8 m is no
    accident: in a survivor, or in a branch whose pelvis or limbs were then judged. Where none is visible there
    is no evidence, and a branch that happens to reach its rays must not stand for the truth.
    """
    leaves = batch.leaves
    fits = np.ones(len(leaves.code), dtype=bool)
    seen = np.zeros(len(leaves.code), dtype=bool)
    nodes = np.arange(len(leaves.code))
    for segment in RIGID_SEGMENTS:
        ends = leaves.positions(segment, nodes)
        length = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=-1)
        known = np.isfinite(length)
        fits &= ~known | (np.abs(length - batch.figure.lengths[segment_name(segment)]) <= EXACT.rigid)
        seen |= known
    exact = np.zeros(leaves.n_frames, dtype=bool)
    exact[leaves.frame[fits & seen]] = True
    empty = batch.physical[:, -1] == 0
    for group in leaves.pruned:
        if group.level >= JOINT["left_hip"] and group.check in ("joint_range", "collision"):
            exact[group.frame[empty[group.frame]]] = True
    return exact


def _refuse_impossible(frames: Sequence[FrameRecovery]) -> None:
    """Refuse a view in which no frame has a posture because a segment is too short for its image."""
    if any(len(frame) for frame in frames):
        return
    for k, frame in enumerate(frames):
        short = frame.too_short()
        if short is not None:
            segment, missing = short
            raise InputError(
                f"frames[{k}]: the segment {segment} is at least {missing * 100:.3g} cm too short for its image; "
                "correct its length or its image points, or give a larger --tangent-tolerance"
            )
