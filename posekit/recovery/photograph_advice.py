"""What would have to be wrong in a photograph in which no posture is found."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from posekit.geometry import Array
from posekit.recovery.noise import Noise
from posekit.recovery.photograph import PhotographRefiner
from posekit.recovery.recovery import Recovery
from posekit.skeleton import JOINTS, SEGMENT_NAMES, SEGMENTS

LOOSENED_TIMES: Final = (2.0, 4.0, 8.0)
"""Times the deviations of image points, one after the other until a posture is found."""

MOST_NAMED: Final = 3
"""Joints and lengths that are named of a photograph, the worst first."""

LEAST_NAMED: Final = 1.5
"""Deviations by which something is off that is named beside the worst."""


@dataclass(frozen=True, kw_only=True)
class Departure:
    """What is off in the likeliest posture.

    Parameters
    ----------
    deviations : float
        By how many standard deviations.
    says : str
        What, and by how much.
    """

    deviations: float
    says: str


def photographs_of(recovery: Recovery) -> PhotographRefiner | None:
    """Make again what refined the photographs of a recovery; None where nothing did."""
    noise = recovery.settings.get("noise")
    if recovery.grower is None or noise is None:
        return None
    return PhotographRefiner.of(recovery.grower, Noise.from_document(noise))


def photograph_line(refiner: PhotographRefiner, frame: int) -> str:
    """Say of a frame without a posture what would have to be wrong in the picture for one to be likely.

    Parameters
    ----------
    refiner : PhotographRefiner
        What found no posture.
    frame : int
        Its number in the view, counted from 0.

    Returns
    -------
    str
        The joints and lengths that are off most in the posture that is likeliest when image points may be off by
        several times as much as they are elsewhere.
    """
    for factor in LOOSENED_TIMES:
        loose = replace(refiner, loosened=factor)
        found = loose.grow(np.array([frame]))[frame]
        if found.batch is not None and found.survivors and found.batch.refined is not None:
            first = int(found.batch.offsets[found.index])
            refined = found.batch.refined.part(slice(first, first + found.survivors))
            departures = _departures(refiner, frame, refined.joints[int(np.argmin(refined.chi2))])
            return "; ".join(one.says for one in departures)
    return f"none even with image points off by {LOOSENED_TIMES[-1]:g} times as much as people put them"


def _departures(refiner: PhotographRefiner, frame: int, joints: Array) -> list[Departure]:
    """List what is off in a posture (14, 3), the worst first."""
    row = np.flatnonzero(refiner.fit.frame == frame)
    camera = refiner.fit.cameras(row)
    seen = refiner.observe(row, camera)
    scale = float(seen.focal[0])
    image, deviation = seen.sight.points()[0], seen.deviation[0, : len(JOINTS)]
    model = np.asarray(camera.project(joints[None]))[0]
    found = []
    for joint, name in enumerate(JOINTS):
        off = float(np.linalg.norm(model[joint] - image[joint]))
        if np.isfinite(off) and refiner.trunk.told[frame, joint]:
            says = f"{name} would have to be {off:.0f} px ({off / scale * 100:.0f} cm) from where it is seen"
            found.append(Departure(deviations=off / float(deviation[joint]), says=says))
    lengths, own = refiner.grower.body.figure.lengths, refiner.noise.lengths.own
    for name, (a, b) in zip(SEGMENT_NAMES, SEGMENTS, strict=True):
        longer = float(np.log(np.linalg.norm(joints[a] - joints[b]) / lengths[name]))
        if np.isfinite(longer) and own[name]:
            other = "longer" if longer > 0 else "shorter"
            says = f"{name} would have to be {abs(np.expm1(longer)) * 100:.0f} % {other}"
            found.append(Departure(deviations=abs(longer) / own[name], says=says))
    found.sort(key=lambda one: -one.deviations)
    return [found[0], *(one for one in found[1:MOST_NAMED] if one.deviations > LEAST_NAMED)]
