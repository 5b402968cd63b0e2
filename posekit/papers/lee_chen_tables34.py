"""Tables 3 and 4 and §4.2 of Lee & Chen 1985 again, with posekit's walker at all settings the paper leaves open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own import View
from posekit.geometry import Array
from posekit.papers import lee_chen_printed as printed
from posekit.recovery.conductor import recover
from posekit.recovery.recovery import FrameRecovery, Recovery
from posekit.settings import CheckSettings, Tolerance
from posekit.skeleton import JOINTS
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

SAME_POSTURE_METRES = 1e-6
"""Metres within which all joints of a survivor must lie to be the input."""

Effort = Literal["quick", "fine"]


@dataclass(frozen=True, kw_only=True)
class WalkGrid:
    """The settings over which the paper's counts are looked at.

    Parameters
    ----------
    velocities : sequence of float
        Leg lengths a second.
    leans : sequence of float
        How far the back leans forward besides, degrees.
    phases : int
        Phases of frame 1, evenly over the cycle from 0.
    """

    velocities: Sequence[float]
    leans: Sequence[float]
    phases: int

    def __len__(self) -> int:
        """Return the number of settings."""
        return len(self.velocities) * len(self.leans) * self.phases


WALK_GRIDS: dict[Effort, WalkGrid] = {
    "quick": WalkGrid(velocities=(0.5, 0.7, 0.9, 1.1, 1.3), leans=(-4.0, -2.0, 0.0, 2.0, 4.0), phases=20),
    "fine": WalkGrid(
        velocities=(0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3),
        leans=(-4.0, -3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0, 4.0),
        phases=100,
    ),
}
"""All of mid gait, and as much lean besides as the gait itself has."""


@dataclass(frozen=True, kw_only=True, eq=False)
class WalkCounts:
    """One sequence at S settings of the walker, counted as the paper counts it.

    Parameters
    ----------
    name : str
        ``seq1`` or ``seq2``.
    settings : array (S, 3)
        Velocity (leg lengths/s), lean (degrees), phase of frame 1 (cycles).
    physical, motion : int array (S, 3, 14)
        Survivors by frame 1, 3, 5 and level: after the physical checks, and after Rules 1 and 2 too.
    grouped : int array (S,)
        Groups of frame 1 then.
    final : int array (S, 2)
        Frame 1: groups after Rules 1-5, and their survivors.
    truth : bool array (S,)
        Whether the input is among them.
    """

    name: str
    settings: Array
    physical: NDArray[np.int64]
    motion: NDArray[np.int64]
    grouped: NDArray[np.int64]
    final: NDArray[np.int64]
    truth: NDArray[np.bool_]

    def __post_init__(self) -> None:
        for name in ("settings", "physical", "motion", "grouped", "final", "truth"):
            values = np.array(getattr(self, name))
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    @property
    def cells(self) -> NDArray[np.int64]:
        """All counts that the paper prints of this sequence (S, 86): its table's, and §4.2's two."""
        tables = np.stack([self.physical, self.motion], axis=1)
        last = np.column_stack([self.grouped, self.final[:, 0]])
        return np.concatenate([tables.reshape(len(tables), -1), last], axis=1)

    @property
    def printed_cells(self) -> NDArray[np.int64]:
        """What stands there (86,)."""
        tables = np.array([printed.PRINTED_PHYSICAL[self.name], printed.PRINTED_MOTION[self.name]])
        return np.concatenate([tables.ravel(), printed.PRINTED_FINAL[self.name][1:]])

    @property
    def distance(self) -> Array:
        """How far each setting is from the print (S,): summed over all cells, how many octaves they are apart."""
        # A count of zero is taken for half a survivor: its logarithm must be finite.
        return np.asarray(np.abs(np.log2(np.maximum(self.cells, 0.5) / self.printed_cells)).sum(axis=1))


def cell_names() -> list[tuple[str, int, str]]:
    """Name the columns of `WalkCounts.cells`: what was applied, the frame, and the joint or the step of §4.2."""
    columns = product(("physical", "rules 1-2"), printed.PRINTED_FRAMES, JOINTS)
    return [*columns, ("grouped", 1, "all"), ("rules 3-5", 1, "all")]


def walk_counts(name: str, grid: WalkGrid, tolerance: Tolerance = PAPER_TOLERANCE) -> WalkCounts:
    """Count one sequence at all settings of a grid.

    Parameters
    ----------
    name : {"seq1", "seq2"}
        Which sequence.
    grid : WalkGrid
        Velocities, leans and phases of frame 1: all of them with all.
    tolerance : Tolerance
        The paper prints none.
    """
    parts = [
        _counted(name, velocity, lean, grid.phases, tolerance)
        for velocity, lean in product(grid.velocities, grid.leans)
    ]
    fields = ("settings", "physical", "motion", "grouped", "final", "truth")
    return WalkCounts(
        name=name, **{field: np.concatenate([getattr(part, field) for part in parts]) for field in fields}
    )


def closest_setting(counts: Sequence[WalkCounts]) -> int:
    """Return the row of the one setting at which all cells of all sequences together are closest to the print."""
    return int(np.argmin(np.sum([one.distance for one in counts], axis=0)))


def recover_sequence(name: str, setting: Array) -> tuple[View, Recovery]:
    """Recover the five frames of a sequence as the paper does, with Rules 1 and 2.

    Parameters
    ----------
    name : {"seq1", "seq2"}
        Which sequence.
    setting : array (3,)
        See `WalkCounts.settings`.
    """
    velocity, lean, phase = setting
    walker = Walker(velocity=velocity, lean=float(np.radians(lean)))
    scene = walker_scene(walker, camera=SEQUENCE_CAMERAS[name], dt=FRAME_TIME, phase0=phase)
    return view_of(scene), _recover(scene, (1, 2), PAPER_TOLERANCE)


def _counted(name: str, velocity: float, lean: float, phases: int, tolerance: Tolerance) -> WalkCounts:
    walker = Walker(velocity=velocity, lean=float(np.radians(lean)))
    cycle = walker.gait.cycle_duration
    # One scene for each printed frame holds all phases: frame k of it is that frame of the k-th sequence.
    by_frame = []
    for frame in printed.PRINTED_FRAMES:
        scene = walker_scene(
            walker,
            camera=SEQUENCE_CAMERAS[name],
            frames=phases,
            dt=cycle / phases,
            phase0=(frame - 1) * FRAME_TIME / cycle,
        )
        by_frame.append((scene, _recover(scene, (1, 2), tolerance)))
    first, after_rules_12 = by_frame[0]
    last = _recover(first, (1, 2, 3, 4, 5), tolerance).frames
    levels = {
        key: np.array([[one.levels[key] for one in recovery.frames] for _, recovery in by_frame])
        for key in ("physical", "motion")
    }
    errors = [
        np.linalg.norm(one.joints - truth, axis=-1).max(axis=1)
        for one, truth in zip(last, first.joints_cam, strict=True)
    ]
    return WalkCounts(
        name=name,
        settings=np.array([(velocity, lean, k / phases) for k in range(phases)]),
        physical=levels["physical"].swapaxes(0, 1),
        motion=levels["motion"].swapaxes(0, 1),
        grouped=np.array([_groups(one) for one in after_rules_12.frames]),
        final=np.array([(_groups(one), len(one)) for one in last]),
        truth=np.array([bool((error < SAME_POSTURE_METRES).any()) for error in errors]),
    )


def _recover(scene: SyntheticScene, rules: tuple[int, ...], tolerance: Tolerance) -> Recovery:
    view = view_of(scene)
    return recover(
        view,
        checks=PAPER_CHECKS,
        ranges="table1-printed",
        walkers="paper-printed",
        rules=rules,
        tolerance=tolerance,
        group=GROUPING_METRES,
    )


def _groups(frame: FrameRecovery) -> int:
    return 0 if frame.groups is None else len(set(frame.groups.tolist()))
