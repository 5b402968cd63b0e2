"""Evaluation of recovery with given settings: views of known postures at several levels of image noise."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from posekit.cameras import LeeChenCamera, View
from posekit.errors import PosekitError, refusal, shown
from posekit.evaluation.evaluate import Evaluation, evaluate
from posekit.geometry import Array
from posekit.motion import Motion
from posekit.progress import watched
from posekit.recovery import Answer, Frames, Recovery, Survivors
from posekit.settings import RecoverSettings
from posekit.skeleton import JOINTS, POINTS
from posekit.synthesis import mocap_views


def evaluate_method(
    source: View | Motion | Iterable[tuple[dict[str, Any], View]],
    settings: RecoverSettings | None = None,
    *,
    noise: Sequence[float] = (0.0,),
    views: int = 24,
    seed: int = 0,
) -> Evaluation:
    """Recover views of known postures at several levels of image noise, and measure the errors of every frame.

    Standard normal noise is drawn once for each frame, and multiplied by each noise level. If the recovery of a view
    fails, its frames count as frames without survivors.

    Parameters
    ----------
    source : View, Motion, or iterable of (dict, View)
        A view with truth; or motion capture, from which frames are chosen evenly and each is projected by its own
        random camera; or pairs of a view and the values of its columns `posekit.evaluation.evaluate.KEYS`.
    settings : RecoverSettings, optional
        Settings of every recovery.
    noise : sequence of float
        Standard deviations of each coordinate of the image points, pixels.
    views : int
        Number of frames that are chosen from a motion.
    seed : int
        Seed of the noise and of the cameras.

    Raises
    ------
    InputError
        If an argument is invalid, a view has no truth, or there is no view.
    """
    if not noise or not all(0 <= level < np.inf for level in noise) or len(set(noise)) != len(noise):
        raise refusal("", "noise", shown(list(noise)), "different numbers, 0 or more", "correct them")
    from posekit.recovery.conductor import recover

    settings = RecoverSettings.of(settings)
    parts = []
    if isinstance(source, Motion):
        complete = int(np.isfinite(source.figure_joints).all(axis=(1, 2)).sum())
        drawn = mocap_views(source, min(views, max(complete, 1)), np.random.default_rng(seed))
        source = [({"clip": each.source}, each) for each in drawn]
    given = [({}, source)] if isinstance(source, View) else source
    for number, (keys, view) in enumerate(watched(given, "evaluating")):
        draw = np.random.default_rng((seed, number)).standard_normal((len(view), len(POINTS), 2))
        for level in noise:
            part = noisy(view, level, draw)
            try:
                result = recover(part, settings)
            except PosekitError as error:
                result = _empty(part, str(error))
            parts.append(evaluate(result, part.truth, seed=seed).with_keys(**keys, noise=level))
    if not parts:
        raise refusal("", "views", "none", "views with truth", "take more frames, or a larger distance")
    about = {"noise_px": list(noise), "seed": seed}
    return Evaluation.joined(parts, {**about, "recover": dict(parts[0].settings)})


def noisy(view: View, level: float, draw: Array) -> View:
    """Add the noise `level` (pixels) times `draw` (F, 19, 2) to image points; necks of known position are unchanged.

    Raises
    ------
    InputError
        If the camera is Lee & Chen's, whose image points are lengths.
    """
    if level == 0:
        return view
    if isinstance(view.camera, LeeChenCamera):
        raise refusal(view.source, "noise", f"{level:g} px", "0 for lee-chen cameras", "it is in metres")
    image = view.image + level * draw[:, : len(JOINTS)]
    given = np.isfinite(view.root).all(axis=1)
    image[given, 0] = view.image[given, 0]
    head = view.head_image + level * draw[:, len(JOINTS) :]
    deviation = float(np.hypot(level, view.deviation or 0.0))
    return replace(view, image=image, head_image=head, deviation=deviation)


def _empty(view: View, reason: str) -> Recovery:
    """Return a result without survivors, for a view whose recovery failed."""
    count = len(view)
    nothing = np.full((count, len(JOINTS), 3), np.nan)
    return Recovery(
        survivors=Survivors(frame=np.empty(0, dtype=np.intp), joints=nothing[:0], q=np.empty((0, 0))),
        frames=Frames(time=view.time, reason=[reason] * count),
        answer=Answer(joints=nothing, sure=np.full(count, np.nan)),
        camera=view.camera.fields(),
        source=view.source,
    )
