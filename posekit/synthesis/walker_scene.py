"""Views of the walker: from any camera, and the paper's two sequences."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from posekit.cameras import lee_chen
from posekit.errors import InputError
from posekit.formats.own.units import check_step
from posekit.synthesis.camera_sphere import CameraPlacements
from posekit.synthesis.observe import observe
from posekit.synthesis.synthetic_scene import SyntheticScene
from posekit.synthesis.viewpoints import look_at
from posekit.synthesis.walker import Walker

F = 0.05
"""Distance of the paper's image plane from the centre of projection, metres (Table 2: 5 cm)."""

N_FRAMES = 5
FRAME_TIME = 0.2
"""Seconds a frame (Lee & Chen 1985, Appendix)."""

SEQ1_CAMERA = (4.0, 0.0, 0.0)
SEQ2_CAMERA = (3.0, 0.0, 3.0)
"""The paper's camera positions, metres: image-plane origins in the head-centred frame."""

SEQ_VELOCITY = 0.7
SEQ1_PHASE0 = 0.11
SEQ2_PHASE0 = 0.68
"""What the paper does not tell: the velocity (leg lengths/s) and the phase of frame 1. The built-in sequences have
these; `posekit reproduce lee-chen` takes none for granted and counts over all."""

UP_WORLD = np.array([0.0, 1.0, 0.0])


def walker_scene(
    walker: Walker,
    *,
    camera: ArrayLike = SEQ1_CAMERA,
    target: ArrayLike = (0.0, 0.0, 0.0),
    f: float = F,
    frames: int = N_FRAMES,
    dt: float = FRAME_TIME,
    phase0: float = 0.0,
    carried: bool = True,
) -> SyntheticScene:
    """View a walker with the camera of the 1985 paper.

    Parameters
    ----------
    walker : Walker
        Who walks, and how fast.
    camera : array (3,)
        The camera's position as the paper counts it: the origin of the image plane, head-centred frame (x
        forward, y up, z right), metres. The optical centre is f further back.
    target : array (3,)
        Where it looks, head-centred frame, metres: the origin, which is horizontal for a camera at y = 0.
    f : float
        From the centre of projection to the image plane, metres.
    frames : int
        How many frames are made.
    dt : float
        Seconds between frames.
    phase0 : float
        Phase of the first frame, in cycles; at 0 the right foot strikes.
    carried : bool
        The camera goes along with the walker's head, as on a treadmill: what the paper did. Otherwise it
        stands, and the walker comes from where Table A.2 has the head.

    Returns
    -------
    SyntheticScene
        Its world is the head-centred frame (of the first frame, where the camera stands).

    Raises
    ------
    InputError
        Where a number is impossible, or the walker passes the camera.
    """
    if frames < 1:
        raise InputError(f"the walker has {frames} frames; ask for one or more")
    check_step(dt)
    if not math.isfinite(phase0):
        raise InputError(f"phase0 is {phase0:g}; expected finite, in cycles")
    position, aim = np.asarray(camera, dtype=np.float64), np.asarray(target, dtype=np.float64)
    if position.shape != (3,) or aim.shape != (3,) or not np.isfinite([position, aim]).all():
        raise InputError(
            f"the camera is at {position.tolist()} and looks at {aim.tolist()}; expected three finite "
            "numbers x, y, z each, metres"
        )
    pinhole = lee_chen.pinhole(f)
    R = look_at(position, aim, UP_WORLD)
    time = dt * np.arange(frames, dtype=np.float64)
    q = walker.configurations(walker.phase(time, phase0))
    if not carried:
        q[:, :3] += walker.travel(time, phase0)
    # The paper's camera is at the middle of the image plane, one focal length in front of the optical centre.
    placements = CameraPlacements(
        R_cam_world=np.broadcast_to(R, (frames, 3, 3)),
        position=np.broadcast_to(position - f * R[2], (frames, 3)),
    )
    points = walker.figure.forward_kinematics(q)
    return replace(observe(walker.figure, pinhole, points, placements, q=q, time=time), lee_chen_f=f)


def seq1(*, velocity: float = SEQ_VELOCITY, phase0: float = SEQ1_PHASE0) -> SyntheticScene:
    """Make the built-in SEQ1: the walker comes towards the camera, which is straight ahead."""
    return walker_scene(Walker(velocity=velocity), camera=SEQ1_CAMERA, phase0=phase0)


def seq2(*, velocity: float = SEQ_VELOCITY, phase0: float = SEQ2_PHASE0) -> SyntheticScene:
    """Make the built-in SEQ2: the camera is ahead of the walker, and to the right."""
    return walker_scene(Walker(velocity=velocity), camera=SEQ2_CAMERA, phase0=phase0)
