"""One view in, every physically possible posture out: root, tree, refine, certify, rank, answer."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure, LengthUncertainty, load_figure
from posekit.errors import InputError
from posekit.formats.own import OpenCVModel, ScaledOrthographicModel, View
from posekit.formats.own.camera_model import camera_fields
from posekit.formats.own.units import PER_METRE
from posekit.ranking import Up
from posekit.recovery.body import FigureBody, LiftedBody, loaded
from posekit.recovery.camera_record import CameraRecords
from posekit.recovery.fit_camera import CameraFit, fit_camera
from posekit.recovery.grower import Grower
from posekit.recovery.judged import record_of
from posekit.recovery.noise import Noise
from posekit.recovery.observed import lost_to, trunkless, with_reasons
from posekit.recovery.person import FEWEST_CLIP_FRAMES, body_of, refuse_settings, uncertainty_of
from posekit.recovery.ranked import up_of
from posekit.recovery.recovery import FrameRecovery, Recovery
from posekit.recovery.rooting import tolerance_of
from posekit.recovery.trees import FrameTrees, trees_of
from posekit.settings import (
    EXACT_TOLERANCE,
    MEASURED_TOLERANCE,
    PHOTOGRAPH_TOLERANCE,
    Judged,
    RecoverSettings,
    Tolerance,
)

if TYPE_CHECKING:
    from posekit.objects.nearer_ends import NearerEnds
    from posekit.recovery.refiner import Refiner

FRAMES_AT_ONCE = 2000
"""Frames grown together: enough to spread NumPy's overhead and to keep all cores busy."""

LEAST_DOUBTS, DOUBTED_SHARE = 3, 0.15
"""Frames, and what share of them, that come back empty with lengths at their word before none is taken so.

Of real motion and lengths that are right some 3 % of frames do, with 3 % off each 46 % (docs, "How long a person's
segments are").
"""

OPEN_HYPOTHESES_AT_ONCE = 250
"""Hypotheses grown together where depth or scale is open: each may have thousands of leaves."""


def recover(
    view: View,
    settings: RecoverSettings | None = None,
    *,
    figure: Figure | None = None,
    progress: Callable[[int], None] | None = None,
    **changes: Any,
) -> Recovery:
    """Recover every posture behind a view that passes the checks.

    Parameters
    ----------
    view : View
        What was seen.
    settings : RecoverSettings, optional
        What is asked; the usual if not given.
    figure : Figure, optional
        The built-in one if not given; the view's own lengths, stature and head points are applied to it.
    progress : callable, optional
        Called with the number of frames done since the last call.
    **changes
        Single settings that are other than those, by the names of the fields of `RecoverSettings`, as
        ``ranges="table1"``.

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
    >>> recovery = posekit.recover(posekit.builtin_view("seq1"), contact_margin=0.01)
    >>> len(recovery.frames)
    5
    """
    asked = loaded((settings or RecoverSettings()).changed(**changes))
    refuse_settings(view, asked)
    uncalibrated = isinstance(view.camera, ScaledOrthographicModel)
    tolerance = asked.tolerance_for(PHOTOGRAPH_TOLERANCE if uncalibrated else MEASURED_TOLERANCE)

    # Root: whose body it is, where the camera sees it, and where the tree grows from.
    body = body_of(view, figure or load_figure(), asked.proportions)
    bare = trunkless(view, body)
    lengths = uncertainty_of(view, asked.length_deviation, own_figure=figure is not None)
    noise = _noise(view, body, asked, lengths)
    photographs = uncalibrated and noise is not None
    fit = _fit(view, body, asked, tolerance, lengths, refuse=not photographs)
    fit = replace(fit, reasons=with_reasons(fit.reasons, body, bare))

    # Tree and refinement: as exact where that may be, then lengths at their word, then as uncertain as they are.
    at_their_word = noise is None or _lengths_may_be_right(
        view, asked, own_figure=photographs or figure is not None
    )
    asked_trunks = noise is None or photographs
    grower = Grower(view=view, fit=fit, body=body, settings=asked, nearer=_nearer(asked, body, len(view)))
    refiner: Refiner | None = None
    trees: dict[int, FrameTrees] = {}
    for part in _parts(fit):
        inexact = part
        if tolerance is None and len(rows := grower.closing(part)):
            batch = grower.grow(rows, EXACT_TOLERANCE, "exact")
            trees |= trees_of(batch, fit, rows)
            inexact = part[~np.isin(fit.frame[part], fit.frame[rows[batch.exact]])]
        uncertain = _distinct(fit.frame[inexact])
        if at_their_word and not asked_trunks and len(uncertain):
            at_their_word, asked_trunks = _lengths_fit(view, fit, body), True
        if at_their_word:
            for rows, allowed, judged in _by_tolerance(fit, inexact, tolerance):
                batch = grower.grow(rows, allowed, judged)
                trees |= trees_of(batch, fit, rows)
                # Frames in which nothing is left may have hips that are off by as much as the rest.
                lost = rows[~np.isin(fit.frame[rows], fit.frame[rows[batch.leaves.frame]])]
                if allowed.hips < 1 and judged != "given" and len(lost):
                    trees |= trees_of(grower.grow(lost, replace(allowed, hips=1.0), judged), fit, lost)
            empty = np.array([not trees[k].survivors for k in uncertain.tolist()], dtype=np.bool_)
            if empty.sum() < max(LEAST_DOUBTS, DOUBTED_SHARE * len(uncertain)):
                uncertain = uncertain[empty]
        if noise is not None and not photographs and len(uncertain):
            refiner = refiner or _refiner(grower, noise, most=_share(uncertain, fit.frame[part]) > 0.5)
            trees |= _refined(refiner, uncertain, trees)
        if progress is not None:
            progress(len(_distinct(fit.frame[part])))
    if refiner is not None:
        noise, grower, body = refiner.noise, refiner.grower, refiner.grower.body
        trees |= _found_again(refiner, fit)
    if photographs and noise is not None:
        # Seen with noise, or nothing is left by tolerances: a body of other lengths, or not all of a trunk is seen.
        undecided = np.array(
            [k for k in range(len(view)) if k not in trees or trees[k].undecided], dtype=np.intp
        )
        if len(undecided):
            trees |= _refiner(grower, noise).grow(undecided)

    # Answer: what is left of each frame, and what it was judged with; ranks and certificates are made when asked for.
    frames = _frames(view, trees, fit, asked.group, bare)
    _refuse_impossible(frames)
    up = up_of(view.camera)
    record = {**_record(asked, tolerance, body, frames, noise, up), **_told(view, refiner, trees)}
    return Recovery(figure=body.figure, fit=grower.fit, frames=frames, settings=record, grower=grower, up=up)


def _refined(
    refiner: Refiner, frames: NDArray[np.intp], trees: Mapping[int, FrameTrees]
) -> dict[int, FrameTrees]:
    """Refine some frames; those of which nothing is left once more, where nobody says how well lengths are known.

    Of a detector's points, outliers are taken for not seen.
    """
    view, asked = refiner.grower.view, refiner.grower.settings
    if view.derived:
        from posekit.recovery.outliers import grow_trusted

        found = grow_trusted(refiner, frames)
    else:
        found = refiner.grow(frames)
    said = asked.length_deviation is not None or view.length_deviation is not None
    lost = np.array([k for k in frames.tolist() if not found[k].survivors], dtype=np.intp)
    if len(lost) and not said:
        found |= {k: one for k, one in refiner.less_sure().grow(lost).items() if one.survivors}
    # Survivors without a place for what was not seen are still more than none.
    return {k: one for k, one in found.items() if one.survivors or not _grown(trees.get(k))}


def _frames(
    view: View,
    trees: Mapping[int, FrameTrees],
    fit: CameraFit,
    group: float | None,
    bare: NDArray[np.bool_],
) -> list[FrameRecovery]:
    """Say what is left of each frame; `bare` (F,) is whether it shows too little of a trunk."""
    frames = []
    cameras = CameraRecords(view=view, fit=fit)
    for k, time in enumerate(view.time.tolist()):
        one = trees.get(k) or FrameTrees(batch=None, index=0, hypotheses=1, fit=fit)
        frames.append(
            FrameRecovery(
                time=time,
                batch=one.batch,
                index=one.index,
                hypotheses=one.hypotheses,
                family=None if one.fit.families is None else one.fit.families[k],
                placement=None if one.fit.placements is None else one.fit.placements[k],
                reason=one.fit.reasons[k],
                lost_to=lost_to(view, k, without_trunk=bool(bare[k])),
                group_within=group,
                number=k,
                cameras=cameras,
                unlisted=one.unlisted,
                unlisted_probability=one.unlisted_probability,
                made_of=one.posture_set,
            )
        )
    return frames


def _record(
    asked: RecoverSettings,
    tolerance: Tolerance | None,
    body: LiftedBody,
    frames: Sequence[FrameRecovery],
    noise: Noise | None,
    up: Up,
) -> dict[str, Any]:
    """Gather what decided the result; the noise of photographs only where one was refined with it."""
    photographs = any(frame.family is not None for frame in frames)
    unused = photographs and all(frame.judged != "refined" for frame in frames)
    record = record_of(
        asked,
        tolerance,
        body.figure,
        [(frame.judged, frame.tolerance) for frame in frames],
        None if noise is None or unused else noise.document(),
        up,
    )
    return record | {"contact_margin": record["contact_margin"] + body.overlap}


def _told(view: View, refiner: Refiner | None, trees: Mapping[int, FrameTrees]) -> dict[str, Any]:
    """Return what results say of the camera, the one body of a clip, and the points that were not believed."""
    found = {str(k): list(one.outliers) for k, one in sorted(trees.items()) if one.outliers}
    said: dict[str, Any] = {"outliers": found} if found else {}
    if isinstance(view.camera, OpenCVModel):
        said["camera"] = camera_fields(view.camera, "m")
    return said if refiner is None or refiner.clip is None else said | {"one_body": refiner.clip.document()}


def _share(some: NDArray[np.intp], frames: NDArray[np.intp]) -> float:
    """Return which share of different frames some are."""
    return len(some) / max(len(_distinct(frames)), 1)


def _found_again(refiner: Refiner, fit: CameraFit) -> dict[int, FrameTrees]:
    """Grow frames whose necks could not be placed, but can by the lengths that were found, or without an outlier."""
    found = [k for k, why in enumerate(fit.reasons) if why and not refiner.fit.reasons[k]]
    trees = refiner.grow(np.array(found, dtype=np.intp)) if found and refiner.clip is not None else {}
    view = refiner.grower.view
    nowhere = [k for k, why in enumerate(refiner.fit.reasons) if why and np.isfinite(view.image[k, 0, 0])]
    if view.derived and nowhere:
        from posekit.recovery.outliers import grow_trusted

        again = grow_trusted(refiner, np.array(nowhere, dtype=np.intp))
        trees |= {k: one for k, one in again.items() if one.survivors}
    return trees


def _distinct(frames: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the numbers of frames, each once: asked for values alone, NumPy would load masked arrays first."""
    return np.unique(frames, return_index=True)[0]


def _fit(
    view: View,
    body: LiftedBody,
    asked: RecoverSettings,
    tolerance: Tolerance | None,
    lengths: LengthUncertainty,
    *,
    refuse: bool,
) -> CameraFit:
    """Find the camera, and where it sees the root."""
    if not isinstance(view.camera, ScaledOrthographicModel):
        return fit_camera(view, body.figure, asked.rooting, tolerance, lengths)
    from posekit.recovery.fit_scale import fit_scale

    return fit_scale(view, body, asked.scale_for(PER_METRE[view.unit]), tolerance, refuse=refuse)


def _noise(view: View, body: LiftedBody, asked: RecoverSettings, lengths: LengthUncertainty) -> Noise | None:
    """Say what noise frames are refined with; None where they are not.

    Raises
    ------
    InputError
        Where refinement is asked for that the view or a tolerance forbids, or a deviation that nothing would heed.
    """
    uncalibrated = isinstance(view.camera, ScaledOrthographicModel)
    able = isinstance(view.camera, OpenCVModel) and isinstance(body, FigureBody)
    if uncalibrated and (isinstance(body, FigureBody) or asked.nearer is None):
        from posekit.recovery.photograph import is_photograph, photograph_noise

        able = is_photograph(view, asked)
    if asked.refine and not able:
        raise InputError("--refine: only views of an opencv camera, or of none, are refined; leave it out")
    if asked.refine and asked.tolerance is not None:
        raise InputError("--refine: the noise says what is tolerated; leave out the tolerances, or --refine")
    if asked.refine is False or not able or asked.tolerance is not None:
        if asked.length_deviation:
            raise InputError("--length-deviation: nothing is refined here; leave it out")
        return None
    if uncalibrated:
        return photograph_noise(view, asked, lengths)
    return Noise.of(view, asked.rooting.deviation, lengths, asked=asked.refine)


def _lengths_may_be_right(view: View, asked: RecoverSettings, *, own_figure: bool) -> bool:
    """Tell whether frames are first grown with lengths at their word: a person's, of points that nobody calls noisy."""
    noisy = bool(view.derived) or view.deviation is not None or asked.rooting.deviation is not None
    said = asked.length_deviation if asked.length_deviation is not None else view.length_deviation
    return (own_figure or bool(view.lengths)) and not noisy and not said and not asked.refine


def _lengths_fit(view: View, fit: CameraFit, body: LiftedBody) -> bool:
    """Ask torsos and hips; where all frames are exact, what that needs is not even loaded."""
    from posekit.recovery.length_evidence import lengths_fit

    return lengths_fit(view, fit, body.figure)


def _nearer(asked: RecoverSettings, body: LiftedBody, count: int) -> NearerEnds | None:
    """Read the flips that were given by hand for a number of frames."""
    if asked.nearer is None:
        return None
    from posekit.objects.nearer_ends import NearerEnds

    return NearerEnds.of(asked.nearer, body.linkage, count)


def _refiner(grower: Grower, noise: Noise, *, most: bool = False) -> Refiner:
    """Make what grows frames as their noise demands; where all are exact, what that needs is not even loaded.

    Where `most` frames are not, one body is found for all of them first, if they are enough.
    """
    if isinstance(grower.view.camera, ScaledOrthographicModel):
        from posekit.recovery.photograph import PhotographRefiner

        return PhotographRefiner.of(grower, noise)
    from posekit.recovery.refiner import Refiner

    clip = None
    if most and len(grower.view) >= FEWEST_CLIP_FRAMES and not noise.lengths.exact:
        from posekit.recovery.clip_body import body_of_clip, with_body

        clip = body_of_clip(grower, noise)
        if clip is not None:
            grower, noise = with_body(grower, clip), replace(noise, lengths=clip.varying)
    return Refiner(grower=grower, noise=noise, clip=clip)


def _by_tolerance(
    fit: CameraFit, rows: NDArray[np.intp], given: Tolerance | None
) -> Iterator[tuple[NDArray[np.intp], Tolerance, Judged]]:
    """Yield hypotheses with what they are judged with, and as what: what is given, else what the view allows."""
    if given is not None:
        yield rows, given, "given"
    elif fit.families is not None and len(rows):
        yield rows, PHOTOGRAPH_TOLERANCE, "photograph"
    elif fit.placements is None and len(rows):
        yield rows, MEASURED_TOLERANCE, "measured"
    elif fit.placements is not None:
        by_frame: list[tuple[Tolerance, Judged]] = [
            (tolerance_of(one), "noisy")
            if one is not None and len(one.necks)
            else (MEASURED_TOLERANCE, "measured")
            for one in fit.placements
        ]
        allowed = [by_frame[k] for k in fit.frame[rows].tolist()]
        for one in dict.fromkeys(allowed):
            yield rows[[each == one for each in allowed]], *one


def _parts(fit: CameraFit) -> Iterator[NDArray[np.intp]]:
    """Yield hypotheses that are grown together: whole frames, whose root is known."""
    usable = np.flatnonzero(np.array([not reason for reason in fit.reasons], dtype=np.bool_)[fit.frame])
    if not len(usable):
        return
    frames = fit.frame[usable]
    first = np.flatnonzero(np.diff(frames, prepend=-1)).tolist()
    most = FRAMES_AT_ONCE if fit.families is None and fit.placements is None else OPEN_HYPOTHESES_AT_ONCE
    start = 0
    for k in range(1, len(first) + 1):
        end = first[k] if k < len(first) else len(usable)
        following = first[k + 1] if k + 1 < len(first) else len(usable)
        if k == len(first) or following - start > most:
            yield usable[start:end]
            start = end


def _grown(trees: FrameTrees | None) -> bool:
    """Whether anything survives in a frame's trees."""
    return trees is not None and trees.rows.stop > trees.rows.start


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
