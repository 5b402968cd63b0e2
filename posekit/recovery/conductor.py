"""One view in, every physically possible posture out."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from functools import cache, lru_cache
from importlib.metadata import version
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure, load_figure, stature_from_lengths
from posekit.errors import InputError
from posekit.formats.own import OpenCVModel, ScaledOrthographicModel, View
from posekit.objects.nearer import NearerEnds
from posekit.ranking import Up, load_prior
from posekit.recovery.body import Body, FigureBody, Judges
from posekit.recovery.camera_record import CameraRecords
from posekit.recovery.contact import contact_under_noise
from posekit.recovery.fit_camera import CameraFit, fit_camera
from posekit.recovery.fit_scale import fit_scale
from posekit.recovery.grower import Grower
from posekit.recovery.grown import Grown, grown_of
from posekit.recovery.noise import Noise
from posekit.recovery.recovery import FrameRecovery, Recovery
from posekit.recovery.refiner import Refiner
from posekit.recovery.rooting import tolerance_of
from posekit.recovery.seen import lost_to, neckless, trunkless, with_reasons
from posekit.recovery.taylor_figure.body import TaylorBody
from posekit.settings import EXACT_TOLERANCE, MEASURED_TOLERANCE, PHOTOGRAPH_TOLERANCE, Rooting, Tolerance
from posekit.settings.scale import Scale
from posekit.validators import PHYSICAL, AnyCheck, Ranges, chosen_checks, load_ranges
from posekit.validators.walking import DEFAULT_RULES, thresholds_of

Proportions = Literal["figure", "taylor"]

FRAMES_AT_ONCE = 2000
"""Frames grown together: enough to spread NumPy's overhead and to keep all cores busy."""

PERSONS = 32
"""Figures of persons that are kept: clips and shards of the same person follow each other."""

VAGUE_AT_ONCE = 250
"""Hypotheses grown together where depth or scale is open: each may have thousands of leaves."""


def recover(
    view: View,
    *,
    figure: Figure | None = None,
    checks: Sequence[AnyCheck] = PHYSICAL,
    ranges: str | Ranges = "urdf",
    rules: Sequence[int] = DEFAULT_RULES,
    walkers: str = "paper",
    tolerance: Tolerance | None = None,
    contact_margin: float = 0.0,
    group: float | None = None,
    scale: Scale | None = None,
    proportions: str = "figure",
    nearer: Sequence[Mapping[str, str]] | None = None,
    infer: bool = True,
    rooting: Rooting | None = None,
    refine: bool | None = None,
    length_deviation: float | None = None,
    progress: Callable[[int], None] | None = None,
) -> Recovery:
    """Recover every posture behind a view that passes the checks.

    Parameters
    ----------
    view : View
    figure : Figure, optional
        The built-in one if not given; the view's own lengths, stature and head points are applied to it.
    checks : sequence of str, Check or CheckSettings
        Some of ``rigid-parts``, ``joint-range``, ``collision``, ``walking``, and others, by name or as they are (docs,
        "Write your own check").
    ranges : str or Ranges
        ``urdf``, ``table1``, the path of a TOML table, or ranges.
    rules : sequence of int
        Rules of walking, used where ``walking`` is among the checks.
    walkers : {"paper", "people"}
        Whose thresholds those have: by the paper's word, or as real walkers keep them.
    tolerance : Tolerance, optional
        By default each frame is judged as exact where distances inside torso or hips show that it is, else as
        measured, or as a photograph where the view is uncalibrated.
    contact_margin : float
        Metres that bodies must keep from each other; negative allows penetration.
    group : float, optional
        Metres within which similar survivors are grouped.
    scale : Scale, optional
        How the scale of an uncalibrated view is found: by default the view's own, or the least that the lengths
        allow.
    proportions : {"figure", "taylor"}
        Whose relative lengths an uncalibrated view is lifted with: the figure's, or Taylor's Table 1 (12 points, no
        neck and pelvis).
    nearer : sequence of mapping, optional
        Flips given by hand: segment to the name of its nearer end, one mapping for all frames or one a frame.
    infer : bool
        Whether joints that were not seen are completed: each posture then has a feasible position for them, and says
        which joints were inferred and what else they can be. Otherwise they are NaN.
    rooting : Rooting, optional
        How the neck is found in a calibrated view that neither gives it nor shows a head of six points.
    refine : bool, optional
        Whether frames that are not exact are grown as their noise demands, and every survivor becomes the likeliest
        posture near it (`posekit.refinement`). By default where the noise is known: from `rooting`, from the view, or
        because a detector saw the points; and no tolerance is given.
    length_deviation : float, optional
        Relative standard deviation of lengths, for that; by default what bodies give
        (`posekit.refinement.MEASURED_LENGTH_DEVIATIONS`).
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
    chosen = chosen_checks(checks)
    names = [one.name for one in chosen]
    if group is not None and not (math.isfinite(group) and group >= 0):
        raise InputError(f"--group: {group!r} m; expected zero or a positive length")
    table = load_ranges(ranges) if isinstance(ranges, str) else ranges
    body = body_of(view, figure or load_figure(), proportions)
    judges = Judges(
        checks=chosen,
        ranges=table,
        rules=tuple(rules),
        contact_margin=contact_margin,
        thresholds=thresholds_of(walkers),
    )
    without_neck, bare = neckless(view), trunkless(view, body)
    fit = _fit(view, body, scale, tolerance, rooting)
    fit = replace(fit, reasons=with_reasons(fit.reasons, body, bare))
    noise = _noise(view, body, tolerance, rooting, refine, length_deviation)
    hand = None if nearer is None else NearerEnds.of(nearer, body.linkage, len(view))
    grower = Grower(view=view, fit=fit, body=body, judges=judges, nearer=hand, infer=infer)
    refiner = None if noise is None else Refiner(grower=grower, noise=noise, rooting=rooting)
    grown: dict[int, Grown] = {}
    for part in _parts(fit):
        rows = part if tolerance is not None else grower.closing(part)
        inexact = part
        if len(rows):
            batch = grower.grow(rows, tolerance or EXACT_TOLERANCE)
            grown |= grown_of(batch, fit, rows)
            inexact = part[~np.isin(fit.frame[part], fit.frame[rows[batch.exact]])]
        if tolerance is None:
            if refiner is not None:
                grown |= refiner.grow(np.unique(fit.frame[inexact]))
            else:
                for rows, allowed in _by_tolerance(fit, inexact):
                    grown |= _grown(grower, rows, allowed)
        if progress is not None:
            progress(len(np.unique(fit.frame[part])))
    frames = []
    cameras = CameraRecords(view=view, fit=fit)
    for k, time in enumerate(view.time.tolist()):
        one = grown.get(k) or Grown(batch=None, index=0, hypotheses=1, fit=fit)
        frames.append(
            FrameRecovery(
                time=time,
                batch=one.batch,
                index=one.index,
                hypotheses=one.hypotheses,
                family=None if fit.families is None else fit.families[k],
                placement=None if one.fit.placements is None else one.fit.placements[k],
                reason=one.fit.reasons[k],
                lost_to=lost_to(bool(without_neck[k]), bool(bare[k])),
                group_within=group,
                number=k,
                cameras=cameras,
            )
        )
    _refuse_impossible(frames)
    settings = {
        "checks": [one.to_json() if one.parameters else one.name for one in chosen],
        "ranges": table.name,
        "range_limits": {where: list(bounds) for where, bounds in table.limits.items()},
        "rules": list(rules) if "walking" in names else [],
        "walkers": walkers,
        "tolerance": "exact, else measured" if tolerance is None else asdict(tolerance),
        "exact": asdict(EXACT_TOLERANCE),
        "measured": asdict(MEASURED_TOLERANCE),
        "photograph": asdict(PHOTOGRAPH_TOLERANCE),
        "contact_margin": contact_margin,
        "group": group,
        "figure": body.figure.hash,
        "lengths": dict(body.figure.lengths),
        "judged": [frame.judged for frame in frames],
        "noisy": _widest([frame.tolerance for frame in frames if frame.judged == "noisy"]),
        "refined": _widest(
            [frame.tolerance for frame in frames if frame.judged == "refined"],
            contact=contact_under_noise(contact_margin),
        ),
        "noise": None if noise is None else {**asdict(noise), "by_segment": dict(noise.by_segment)},
        "ranking": {"up": Up.level().says, "prior": load_prior().name},
        "versions": {name: _version(name) for name in ("posekit", "pin", "coal", "numpy")},
    }
    return Recovery(figure=body.figure, fit=fit, frames=frames, settings=settings, grower=grower)


@cache
def _version(name: str) -> str:
    """Return the version of an installed package: reading it takes a millisecond."""
    return version(name)


def person_of(view: View, figure: Figure) -> Figure:
    """Apply a view's own stature, lengths and head points to a figure."""
    head = {
        name: tuple(np.asarray(at, dtype=np.float64).tolist())
        for name, at in (view.head_points or {}).items()
    }
    return _person(figure, view.stature, tuple(view.lengths.items()), tuple(head.items()))


@lru_cache(maxsize=PERSONS)
def _person(
    figure: Figure,
    stature: float | None,
    lengths: tuple[tuple[str, float], ...],
    head_points: tuple[tuple[str, tuple[float, ...]], ...],
) -> Figure:
    """Make the figure of a person: building one takes as long as recovering some hundred frames."""
    if stature is not None:
        figure = figure.from_stature(stature)
    if lengths or head_points:
        figure = figure.scaled(dict(lengths), dict(head_points))
    return figure


def body_of(view: View, figure: Figure, proportions: str) -> Body:
    """Choose what the view's points are lifted into."""
    if proportions == "figure":
        person = person_of(view, figure)
        return FigureBody(
            figure=person,
            stature=view.stature or stature_from_lengths(person.lengths),
            derived=view.derived,
        )
    if proportions == "taylor":
        if not isinstance(view.camera, ScaledOrthographicModel):
            raise InputError(
                "--proportions: taylor is for uncalibrated views (scaled-orthographic); leave the option out"
            )
        return TaylorBody.of(view.stature or stature_from_lengths(person_of(view, figure).lengths), figure)
    raise InputError(f"--proportions: {proportions!r}; expected {' or '.join(get_args(Proportions))}")


def _fit(
    view: View, body: Body, scale: Scale | None, tolerance: Tolerance | None, rooting: Rooting | None
) -> CameraFit:
    if isinstance(view.camera, ScaledOrthographicModel):
        if rooting is not None and rooting != Rooting():
            raise InputError(
                "--root: the view's camera is not known, and so no depth is; leave the option out"
            )
        return fit_scale(view, body, scale, tolerance)
    if scale is not None:
        raise InputError("--scale: the view's camera is calibrated; leave the option out")
    return fit_camera(view, body.figure, rooting, tolerance)


def _noise(
    view: View,
    body: Body,
    tolerance: Tolerance | None,
    rooting: Rooting | None,
    refine: bool | None,
    lengths: float | None,
) -> Noise | None:
    """Say what noise frames are refined with; None where they are not."""
    able = isinstance(view.camera, OpenCVModel) and isinstance(body, FigureBody)
    if refine and not able:
        raise InputError("--refine: only views of a calibrated camera (opencv) are refined; leave it out")
    if refine and tolerance is not None:
        raise InputError("--refine: the noise says what is tolerated; leave out the tolerances, or --refine")
    if refine is False or not able or tolerance is not None:
        if lengths is not None:
            raise InputError("--length-deviation: nothing is refined here; leave it out")
        return None
    deviation = None if rooting is None else rooting.deviation
    return Noise.of(view, deviation, lengths, asked=bool(refine))


def _grown(grower: Grower, rows: NDArray[np.intp], allowed: Tolerance) -> dict[int, Grown]:
    """Grow hypotheses with a tolerance, and those of frames in which nothing is left with as much for the hips."""
    batch = grower.grow(rows, allowed)
    found = grown_of(batch, grower.fit, rows)
    frame = grower.fit.frame[rows]
    lost = rows[~np.isin(frame, frame[batch.leaves.frame])]
    if allowed.hips < 1 and len(lost):
        wide = replace(allowed, hips=1.0)
        found |= grown_of(grower.grow(lost, wide), grower.fit, lost)
    return found


def _by_tolerance(fit: CameraFit, rows: NDArray[np.intp]) -> Iterator[tuple[NDArray[np.intp], Tolerance]]:
    """Yield hypotheses of frames that are not exact with what they are judged with."""
    if fit.families is not None or fit.placements is None:
        if len(rows):
            yield rows, MEASURED_TOLERANCE if fit.families is None else PHOTOGRAPH_TOLERANCE
        return
    by_frame = [
        MEASURED_TOLERANCE if one is None or not len(one.necks) else tolerance_of(one)
        for one in fit.placements
    ]
    allowed = [by_frame[k] for k in fit.frame[rows].tolist()]
    for one in dict.fromkeys(allowed):
        yield rows[[each == one for each in allowed]], one


def _parts(fit: CameraFit) -> Iterator[NDArray[np.intp]]:
    """Yield hypotheses that are grown together: whole frames, whose root is known."""
    usable = np.flatnonzero(np.array([not reason for reason in fit.reasons], dtype=np.bool_)[fit.frame])
    if not len(usable):
        return
    frames = fit.frame[usable]
    first = np.flatnonzero(np.diff(frames, prepend=-1)).tolist()
    most = FRAMES_AT_ONCE if fit.families is None and fit.placements is None else VAGUE_AT_ONCE
    start = 0
    for k in range(1, len(first) + 1):
        end = first[k] if k < len(first) else len(usable)
        following = first[k + 1] if k + 1 < len(first) else len(usable)
        if k == len(first) or following - start > most:
            yield usable[start:end]
            start = end


def _widest(tolerances: Sequence[Tolerance | None], **also: float) -> dict[str, Any] | None:
    """Return the widest of some tolerances, and what was `also` allowed; None where there is none."""
    known = [asdict(one) for one in tolerances if one is not None]
    return {name: max(one[name] for one in known) for name in known[0]} | also if known else None


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
