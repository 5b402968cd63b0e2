"""Which lengths the pictures do not bear out, of frames in which no posture was found."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import PinholeCamera
from posekit.cameras.neck import NeckPlacement, place
from posekit.display.plural import plural
from posekit.errors import PosekitError
from posekit.formats.own import OpenCVModel
from posekit.geometry import Array
from posekit.recovery.fit_camera import CameraFit
from posekit.recovery.grower import Grower
from posekit.recovery.hypotheses import ObservedHypotheses
from posekit.recovery.noise import Noise
from posekit.recovery.recovery import Recovery
from posekit.refinement import LengthDoubt, diagnose
from posekit.skeleton import N_TRUNK_JOINTS, SEGMENT_NAMES, SEGMENTS, segment_name

MAX_FRAMES_DIAGNOSED: Final = 12
"""Frames, spread over all that are empty, in which wrong lengths are looked for."""

MAX_LENGTHS_NAMED: Final = 3
"""Lengths that are doubted aloud."""

ALIKE_FACTOR: Final = 1.2
"""Factors that differ by no more than this are one."""

MIN_FRAMES, MIN_SHARE = 3, 1 / 3
"""A length is too short where as many frames need a longer one, and this share of them: one may have a wrong point."""

ASSUMED_DEVIATION_PIXELS: Final = 2.0
"""Standard deviation of image points of which nobody says it."""

LIMB_SEGMENTS: Final = frozenset(segment_name(pair) for pair in SEGMENTS if max(pair) >= N_TRUNK_JOINTS)
"""Segments of arms and legs: shoulders, pelvis and hips tell the depth without them."""


def length_diagnosis_lines(recovery: Recovery, grower: Grower, lost: list[int]) -> list[str]:
    """Name lengths that cannot be right, where the camera is known.

    Where necks are given, all lengths are looked at. Where they had to be placed, the depth hangs on the very lengths:
    a forearm that is stated too short holds the person too near, and then torso and hips do not close. So the neck is
    placed by torso and hips alone, and arms and legs are named that are too short for that; where torso and hips have
    no explanation either, nothing can be told apart.

    Parameters
    ----------
    recovery : Recovery
        In most of whose frames there is no posture.
    grower : Grower
        Of its view.
    lost : list of int
        Frames of the view in which there is no posture.
    """
    view, fit = grower.view, grower.fit
    if not isinstance(view.camera, OpenCVModel):
        return []
    said = recovery.settings.get("noise")
    noise = Noise(deviation=ASSUMED_DEVIATION_PIXELS) if said is None else Noise.from_document(said)
    frames = np.array(lost, dtype=np.intp)
    given = np.array([fit.placements is None or fit.placements[k] is None for k in lost])
    told = bool(given.any())
    frames = frames[given] if told else frames
    frames = frames[np.linspace(0, len(frames) - 1, min(MAX_FRAMES_DIAGNOSED, len(frames))).astype(np.intp)]
    try:
        doubts = _doubts(
            recovery,
            grower,
            fit if told else _placed_by_trunk(recovery, grower, frames, noise),
            frames,
            noise,
        )
    except PosekitError:
        return []
    if not told:
        return _of_limbs(doubts)
    factors = [doubt.needed / doubt.stated for doubt in doubts]
    if len(doubts) > len(SEGMENT_NAMES) / 2 and max(factors) < ALIKE_FACTOR * min(factors):
        return [
            f"all lengths look stated at {1 / float(np.median(factors)):.2f} of what the pictures need: check unit, "
            "stature and root"
        ]
    return [_said(doubt) for doubt in doubts if _borne_out(doubt)][:MAX_LENGTHS_NAMED]


def _of_limbs(doubts: list[LengthDoubt]) -> list[str]:
    """Name arms and legs that are too short at the depth that torso and hips tell."""
    short = [doubt for doubt in doubts if doubt.needed > doubt.stated and _borne_out(doubt)]
    if any(doubt.segment not in LIMB_SEGMENTS for doubt in doubts) or not short:
        return []
    factors = [doubt.needed / doubt.stated for doubt in short]
    if len(short) > len(LIMB_SEGMENTS) / 2:
        share = 1 / float(np.median(factors))
        return [
            f"{len(short)} lengths of limbs look stated at {share:.2f} of what shoulders, pelvis and hips need; "
            "those are too long, or arms and legs too short: check all lengths"
        ]
    return [
        f"{_said(doubt)} (the neck placed by shoulders, pelvis and hips)"
        for doubt in short[:MAX_LENGTHS_NAMED]
    ]


def _borne_out(doubt: LengthDoubt) -> bool:
    """Tell whether enough frames need a longer one; that one is never seen so long, all of them say."""
    if doubt.needed <= doubt.stated:
        return True
    return doubt.unexplained >= max(min(MIN_FRAMES, doubt.frames), MIN_SHARE * doubt.frames)


def _said(doubt: LengthDoubt) -> str:
    """Say a doubt in a line."""
    if doubt.needed == doubt.least and doubt.needed > doubt.stated:
        return (
            f"{doubt.segment} is stated as {doubt.stated:.3f} m, but {doubt.unexplained} of "
            f"{plural(doubt.frames, 'frame')} need "
            f"{doubt.needed:.3f} m of it or more"
        )
    return str(doubt)


def _doubts(
    recovery: Recovery, grower: Grower, fit: CameraFit, frames: NDArray[np.intp], noise: Noise
) -> list[LengthDoubt]:
    """Ask which lengths some frames contradict, each with the first of its hypotheses."""
    rows = np.flatnonzero(np.isin(fit.frame, frames) & np.isfinite(fit.root).all(axis=1))
    rows = rows[np.flatnonzero(np.diff(fit.frame[rows], prepend=-1))]
    camera = fit.cameras(rows)
    if not len(rows) or not isinstance(camera, PinholeCamera):
        return []
    return diagnose(ObservedHypotheses.of(grower.view, fit, rows, camera, recovery.figure, noise).sight)


def _placed_by_trunk(recovery: Recovery, grower: Grower, frames: NDArray[np.intp], noise: Noise) -> CameraFit:
    """Place the neck of some frames by shoulders, pelvis and hips alone."""
    view, fit = grower.view, grower.fit
    camera = fit.cameras(np.flatnonzero(np.isin(fit.frame, frames))[:1])
    if not isinstance(camera, PinholeCamera):
        raise PosekitError("the camera is not known")
    image = view.image[frames].copy()
    image[:, N_TRUNK_JOINTS:] = np.nan
    found = place(
        PinholeCamera(K=np.asarray(camera.K).reshape(-1, 3, 3)[0], distortion=camera.distortion),
        recovery.figure,
        image,
        deviation=noise.deviation,
        offset=noise.offset,
    )
    placements: list[NeckPlacement | None] = [None] * len(view)
    root = np.full((len(frames), 3), np.nan)
    for row, (k, one) in enumerate(zip(frames.tolist(), found, strict=True)):
        if len(one.necks):
            best = _likeliest(one)
            root[row] = one.necks[best]
            placements[k] = replace(one, necks=one.necks[best : best + 1], misfit=one.misfit[best : best + 1])
    return CameraFit(
        camera=camera,
        frame=frames,
        root=root,
        head=np.full((len(frames), 5, 3), np.nan),
        pose=None,
        reasons=[""] * len(view),
        placements=placements,
    )


def _likeliest(placement: NeckPlacement) -> int:
    """Choose the neck whose depth is nearest to the estimate, or at which the rigid parts close best."""
    if np.isfinite(placement.estimate):
        return int(np.argmin(np.abs(placement.depths - placement.estimate)))
    misfit: Array = np.where(np.isnan(placement.misfit), np.inf, placement.misfit)
    return int(np.argmin(misfit))
