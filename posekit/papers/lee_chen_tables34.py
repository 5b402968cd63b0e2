"""Tables 3 and 4 and §4.2 of Lee & Chen 1985 again, with posekit's own walker."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own import View
from posekit.papers import lee_chen_printed as printed
from posekit.recovery.conductor import recover
from posekit.recovery.recovery import FrameRecovery, Recovery
from posekit.settings import CheckSettings, Tolerance
from posekit.synthesis import SyntheticScene, Walker, walker_scene
from posekit.synthesis.walker_scene import FRAME_TIME, SEQ1_CAMERA, SEQ2_CAMERA
from posekit.validators import ALL_CHECKS
from posekit.views.builtin import view_of

SEQUENCE_CAMERAS = {"seq1": SEQ1_CAMERA, "seq2": SEQ2_CAMERA}
PAPER_TOLERANCE = Tolerance(rigid=0.01, tangent=0.001, placement=False)
"""The paper compares distances and gives no number; 1 cm lets near-frontal torsos stay ambiguous, as its do."""

PAPER_CHECKS = tuple(
    CheckSettings(name=name, parameters={"rigid_mode": "distances"} if name == "rigid-parts" else {})
    for name in ALL_CHECKS
)
"""All checks; of torsos the paper compares distances alone, which do not tell them from their mirror images."""

GROUPING_METRES = 0.05
"""Postures are one group where no joint is farther from that of the group's representative."""

N_PHASES = 100
"""Phases of frame 1 that are searched, evenly over the cycle: the paper does not print which it took."""

SAME_POSTURE_METRES = 1e-6
"""Metres within which all joints of a survivor must lie to be the input."""


@dataclass(frozen=True, kw_only=True)
class Sequence1985:
    """One of the two sequences at one phase, counted as the paper counts it.

    Parameters
    ----------
    name : str
        ``seq1`` or ``seq2``.
    velocity : float
        Leg lengths a second.
    phase : float
        Phase of frame 1, cycles.
    physical, motion : int array (3, 14)
        Survivors by frame 1, 3, 5 and level: after the physical checks, and after Rules 1 and 2 too.
    groups_after_rules_1_2 : int
        Groups of frame 1 then.
    final : tuple of int
        Frame 1: survivors of Rules 1-5, and their groups.
    truth_survives : bool
        Whether the input is among them.
    """

    name: str
    velocity: float
    phase: float
    physical: NDArray[np.int64]
    motion: NDArray[np.int64]
    groups_after_rules_1_2: int
    final: tuple[int, int]
    truth_survives: bool

    @property
    def distance(self) -> float:
        """How far the counts are from the print: the sum over all cells of how many octaves they are apart."""
        # A count of zero is taken for half a survivor: its logarithm must be finite.
        ours = np.maximum(np.stack([self.physical, self.motion]), 0.5)
        print_ = np.array(
            [printed.PRINTED_PHYSICAL[self.name], printed.PRINTED_MOTION[self.name]], dtype=np.float64
        )
        return float(np.abs(np.log2(ours / print_)).sum())


def sequences(name: str, velocity: float, phase0: float = 0.0, count: int = N_PHASES) -> list[Sequence1985]:
    """Count one sequence at phases of frame 1 that are a hundredth of a cycle apart.

    Parameters
    ----------
    name : {"seq1", "seq2"}
        Which sequence.
    velocity : float
        Leg lengths a second.
    phase0 : float
        The first phase, cycles.
    count : int
        How many phases.
    """
    walker = Walker(velocity=velocity)
    cycle = walker.gait.cycle_duration
    # One scene for each printed frame holds all phases: frame k of it is that frame of the k-th sequence.
    by_frame = []
    for frame in printed.PRINTED_FRAMES:
        phase = phase0 + (frame - 1) * FRAME_TIME / cycle
        scene = walker_scene(
            walker, camera=SEQUENCE_CAMERAS[name], frames=count, dt=cycle / N_PHASES, phase0=phase
        )
        by_frame.append((scene, _recover(scene, (1, 2))))
    first, after_rules_12 = by_frame[0]
    after_rules_15 = _recover(first, (1, 2, 3, 4, 5))
    found = []
    for k in range(count):
        last = after_rules_15.frames[k]
        error = np.linalg.norm(last.joints - first.joints_cam[k], axis=-1).max(axis=1)
        levels = [recovery.frames[k].levels for _, recovery in by_frame]
        found.append(
            Sequence1985(
                name=name,
                velocity=velocity,
                phase=phase0 + k / N_PHASES,
                physical=np.stack([counts["physical"] for counts in levels]),
                motion=np.stack([counts["motion"] for counts in levels]),
                groups_after_rules_1_2=_groups(after_rules_12.frames[k]),
                final=(len(last), _groups(last)),
                truth_survives=bool((error < SAME_POSTURE_METRES).any()),
            )
        )
    return found


def closest(name: str, velocity: float) -> Sequence1985:
    """Search the phase at which the counts come closest to the print, the outcome of §4.2 being the paper's.

    Among phases at which the input survives frame 1 in at most as many groups as the paper is left with.
    """
    candidates = sequences(name, velocity)
    allowed = [
        one for one in candidates if one.truth_survives and one.final[1] <= printed.PRINTED_FINAL[name][2]
    ]
    return min(allowed or candidates, key=lambda one: one.distance)


def recover_sequence(found: Sequence1985) -> tuple[View, Recovery]:
    """Recover the five frames of a sequence as the paper does, with Rules 1 and 2."""
    walker = Walker(velocity=found.velocity)
    scene = walker_scene(walker, camera=SEQUENCE_CAMERAS[found.name], dt=FRAME_TIME, phase0=found.phase)
    return view_of(scene), _recover(scene, (1, 2))


def _recover(scene: SyntheticScene, rules: tuple[int, ...]) -> Recovery:
    view = view_of(scene)
    return recover(
        view,
        checks=PAPER_CHECKS,
        ranges="table1-printed",
        walkers="paper-printed",
        rules=rules,
        tolerance=PAPER_TOLERANCE,
        group=GROUPING_METRES,
    )


def _groups(frame: FrameRecovery) -> int:
    return 0 if frame.groups is None else len(set(frame.groups.tolist()))
