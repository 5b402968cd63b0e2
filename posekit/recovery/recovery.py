"""What `recover` returns: every survivor of every frame, and why the rest is gone."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure
from posekit.display.pictured import Pictured
from posekit.display.plural import plural
from posekit.display.stick_drawing import posture_drawing
from posekit.formats.own import Family, Inferred, Root
from posekit.formats.own.posture_set import PostureSet
from posekit.geometry import Array
from posekit.objects.mirror import mirrored
from posekit.ranking import Ranking, Up, deviation_of_tolerance
from posekit.recovery.camera_record import CameraRecords
from posekit.recovery.grouping import group_postures
from posekit.recovery.ranked import ranked
from posekit.recovery.rooting import root_of
from posekit.recovery.trees import Batch
from posekit.recovery.untold import untold_regions
from posekit.settings import Judged, Tolerance
from posekit.skeleton import JOINT, JOINTS, PARENTS

if TYPE_CHECKING:
    from pathlib import Path

    from posekit.answers import Answer
    from posekit.cameras.neck import NeckPlacement
    from posekit.formats.own import View
    from posekit.hidden import CompletedSurvivors
    from posekit.recovery.fit_camera import CameraFit
    from posekit.recovery.grower import Grower
    from posekit.recovery.refined import RefinedSurvivors
    from posekit.viewer.showing import ShownPage

REFINED_LEVEL_METRES: Final = 0.05
"""Metres of depth up to which neither end of a refined segment is nearer: what photographs leave open."""


MAX_DRAWN: Final = 8
"""Postures of a frame in its small drawing."""
CAMERA_UP: Final = np.array([0.0, -1.0, 0.0])
"""Up in a picture."""


def _inferred(completion: CompletedSurvivors, row: int) -> dict[str, Inferred]:
    """Describe the joints of one survivor that were not placed by the image."""
    return {
        region.joint: Inferred(
            kind=region.kind.label,
            lower=region.lower,
            upper=region.upper,
            radius=region.radius,
            fraction=region.fraction,
        )
        for region in completion.regions(row)
    }


@dataclass(frozen=True, kw_only=True)
class PrunedBranch:
    """One pruned branch of the tree and the finding that killed it.

    Parameters
    ----------
    branch : str
        Its near-far choices up to the level where it was pruned; it stands for all leaves that begin so.
    joint : str
        The joint of that level.
    reason : str
        ``check/where``.
    value, lower, upper : float
        What was found, and its bounds, in `unit`.
    """

    branch: str
    joint: str
    reason: str
    value: float
    lower: float
    upper: float
    unit: str


@dataclass(frozen=True, kw_only=True)
class FrameRecovery(Pictured):
    """One frame: its survivors and its losses.

    Parameters
    ----------
    time : float
        Seconds.
    batch : Batch or None
        None where the neck could not be found: nothing was grown.
    index : int
        The place in its batch of the frame's first hypothesis.
    hypotheses : int
        How many there are: one; for an uncalibrated frame as many as scales were taken, for a placed neck as depths,
        under noise as trunks, which may be none.
    family : Family, optional
        The scales that an uncalibrated frame can have.
    placement : NeckPlacement, optional
        How the neck of a calibrated frame was placed, where it was not given.
    reason : str
        Why nothing was grown.
    lost_to : str
        The same in two words, ``what/why``, as leaves are lost to it.
    group_within : float or None
        Metres within which survivors are grouped.
    number : int
        Which frame of the view that was recovered it is.
    cameras : CameraRecords, optional
        Of all frames of the view.
    unlisted : int
        How many postures that were not ruled out are not listed for being too unlikely (`coverage`).
    unlisted_probability : float
        Which share of the frame's probability they have.
    made_of : callable, optional
        Returns the set where not all of its postures are listed: see `posture_set`.
    """

    time: float
    batch: Batch | None
    index: int
    hypotheses: int = 1
    family: Family | None = None
    placement: NeckPlacement | None = None
    reason: str = ""
    lost_to: str = "root/not_known"
    group_within: float | None = None
    number: int = 0
    cameras: CameraRecords | None = None
    unlisted: int = 0
    unlisted_probability: float = 0.0
    made_of: Callable[[], PostureSet] | None = None

    @cached_property
    def _rows(self) -> slice:
        if self.batch is None:
            return slice(0, 0)
        offsets = self.batch.offsets
        return slice(int(offsets[self.index]), int(offsets[self.index + self.hypotheses]))

    def __len__(self) -> int:
        """Count the survivors."""
        return int(self._rows.stop - self._rows.start)

    @property
    def joints(self) -> Array:
        """Survivors (N, 14, 3), OpenCV camera frame, metres; NaN where a joint was not seen."""
        return self.batch.points[self._rows, :14] if self.batch else np.empty((0, 14, 3))

    @cached_property
    def posture_set(self) -> PostureSet:
        """The complete set as trunks and limbs, whatever is listed of it.

        Under noise trunks and limbs are where they are before whole bodies are refined.
        """
        return PostureSet.of(self.joints) if self.made_of is None else self.made_of()

    @property
    def head(self) -> Array:
        """The head's points (5, 3), camera frame, metres; NaN where it was not seen."""
        known = self.batch is not None and self.hypotheses
        return self.batch.leaves.given[self.index] if self.batch and known else np.full((5, 3), np.nan)

    @property
    def scales(self) -> Array | None:
        """The scale of each survivor (N,), pixels a metre; None where the camera is calibrated."""
        if self.family is None or self.batch is None:
            return None if self.family is None else np.empty(0)
        if self.refined is not None:
            return np.full(len(self), self.family.chosen[0])
        return np.asarray(self.family.chosen[self.batch.leaves.frame[self._rows] - self.index])

    @property
    def mirrored(self) -> int:
        """How many survivors have their mirror image among the survivors."""
        if self.batch is None:
            return 0
        if self.refined is None:
            return int(self.batch.mirrored[self._rows].sum())
        one_tree = np.zeros(len(self), dtype=np.intp)
        return int(mirrored(self.joints[..., 2], PARENTS, one_tree, level=REFINED_LEVEL_METRES).sum())

    @property
    def inferred(self) -> list[dict[str, Inferred]] | None:
        """What is known of joints that were not seen, by survivor; None where all were."""
        if self.batch is None:
            return None
        rows = range(self._rows.start, self._rows.stop)
        found: list[dict[str, Inferred]] = [{} for _ in rows]
        if self.batch.completion is not None:
            found = [_inferred(self.batch.completion, row) for row in rows]
        if self.batch.untold is not None and self.refined is not None:
            regions = untold_regions(self.refined, self.batch.untold[self._rows])
            found = [one | region for one, region in zip(found, regions, strict=True)]
        if self.batch.completion is not None or any(found):
            return found
        if not self.batch.body.inferred:
            return None
        columns = [JOINT[name] for name in self.batch.body.inferred]
        return [
            {
                name: Inferred(kind="completed", lower=joints[column], upper=joints[column], radius=0.0)
                for name, column in zip(self.batch.body.inferred, columns, strict=True)
            }
            for joints in self.joints
        ]

    @property
    def q(self) -> Array:
        """Survivors as configurations (N, nq) in Pinocchio's order."""
        return self.batch.q[self._rows] if self.batch else np.empty((0, 0))

    @property
    def fk_distance(self) -> Array:
        """How far the joints of q are from the posture's (N,), metres."""
        return self.batch.fk_distance[self._rows] if self.batch else np.empty(0)

    @property
    def length_residual(self) -> Array:
        """How much too short each survivor's worst segment was for its image (N,), metres."""
        return self.batch.length_residual[self._rows] if self.batch else np.empty(0)

    @property
    def margins(self) -> dict[str, Array]:
        """Each validator's worst margin (N,), degrees or metres; NaN where it decided nothing."""
        if self.batch is None:
            return {}
        return {name: values[self._rows] for name, values in self.batch.margins.items()}

    @property
    def refined(self) -> RefinedSurvivors | None:
        """How likely and how sure each survivor is; None where the frame was not refined."""
        if self.batch is None or self.batch.refined is None:
            return None
        return self.batch.refined.part(self._rows)

    @property
    def chi2(self) -> Array | None:
        """How badly each survivor fits what was seen (N,), where the frame was refined."""
        return None if self.refined is None else self.refined.chi2

    @property
    def spread(self) -> float:
        """How far off survivors are, metres: from the noise where it is known, else from what was tolerated."""
        if self.batch is not None and self.batch.refined is not None:
            return self.batch.spread
        return float(deviation_of_tolerance(self.tolerance.rigid if self.tolerance else 0.0))

    @property
    def branches(self) -> list[str]:
        """The branch code of each survivor: 0 near, 1 far, joints in tree order from the second."""
        if self.batch is None:
            return []
        leaves = self.batch.leaves
        return [f"{code:0{leaves.level}b}" for code in leaves.code[self._rows].tolist()]

    @cached_property
    def groups(self) -> NDArray[np.intp] | None:
        """The group of each survivor, its first member the representative; None if none were asked for."""
        return None if self.group_within is None else group_postures(self.joints, self.group_within)

    @property
    def level_names(self) -> tuple[str, ...]:
        """The joints of the tree, a level each."""
        return JOINTS if self.batch is None else self.batch.leaves.joints

    @property
    def levels(self) -> dict[str, NDArray[np.int64]]:
        """Survivors by level after the ``physical`` checks and after the ``motion`` model (§4.1.B)."""
        if self.batch is None:
            return {name: np.zeros(14, dtype=np.int64) for name in ("physical", "motion")}
        part = slice(self.index, self.index + self.hypotheses)
        motion = self.batch.motion
        physical = motion if self.batch.physical is None else self.batch.physical
        return {"physical": physical[part].sum(axis=0), "motion": motion[part].sum(axis=0)}

    @property
    def rejected(self) -> dict[str, int]:
        """Leaves of the full tree lost to each reason; with the survivors they make 8192 a hypothesis."""
        if self.batch is None:
            return {self.lost_to: 8192}
        if not self.hypotheses:
            return {"noise/no_trunk": 8192}
        lost: Counter[str] = Counter()
        for one in self.batch.rejected[self.index : self.index + self.hypotheses]:
            lost.update(one)
        return dict(lost)

    @property
    def tolerance(self) -> Tolerance | None:
        """The tolerance that this frame was judged with."""
        return self.batch.tolerance if self.batch else None

    @property
    def judged(self) -> Judged | None:
        """How the frame was judged (`posekit.settings.Judged`); None where nothing was grown."""
        return None if self.batch is None else self.batch.judged

    @property
    def camera(self) -> dict[str, Any]:
        """What is known of the camera: f, rotation, position, residual (`posekit.recovery.camera_record`)."""
        return {} if self.cameras is None else self.cameras[self.number]

    @property
    def root(self) -> Root | None:
        """How the neck's depth was found; None where it was given, or the camera is not known."""
        return None if self.placement is None else root_of(self.placement)

    def _facts(self) -> list[str]:
        found = f"nothing grown: {self.reason}" if self.reason else plural(len(self), "posture")
        judged = [] if self.judged is None else [f"judged {self.judged}"]
        return [f"frame {self.number}", f"{self.time:g} s", found, *judged]

    @property
    def likeliest_first(self) -> Array:
        """The survivors (N, 14, 3), the likeliest first, where the camera is level (`posekit.ranking.Up.level`)."""
        if self.batch is None or not len(self):
            return self.joints
        ranking = ranked([self], self.batch.body.figure.lengths, [self.spread], Up.level())
        return np.asarray(self.joints[np.argsort(-ranking.probability, kind="stable")])

    def _drawing(self) -> str:
        return posture_drawing(self.likeliest_first[:MAX_DRAWN], CAMERA_UP)

    def show(self, path: str | Path | None = None) -> ShownPage:
        """Show the frame's survivors to be turned by hand: in the notebook, or in the browser.

        Parameters
        ----------
        path : path, optional
            Where the page is written; one of the temporary files that are kept if not given (`posekit.viewer.showing`).

        Raises
        ------
        InputError
            Where the frame has no posture.
        """
        from posekit.recovery.showing import show_frame

        return show_frame(self, path)

    def too_short(self) -> tuple[str, float] | None:
        """Return the first segment that is too short for its image in every branch, and by how much (m)."""
        if self.batch is None or not self.hypotheses:
            return None
        leaves = self.batch.leaves
        found = leaves.candidates.too_short(self.index) if self.hypotheses == 1 else None
        return (
            None
            if found is None
            else (f"{leaves.joints[leaves.parents[found[0]]]}-{leaves.joints[found[0]]}", found[1])
        )

    def pruned(self) -> list[PrunedBranch]:
        """Every pruned branch with the finding that killed it, in the order of pruning."""
        if self.batch is None:
            return []
        leaves = self.batch.leaves
        return [
            PrunedBranch(
                branch=f"{group.code[k]:0{group.level}b}",
                joint=leaves.joints[group.level],
                reason=f"{group.check}/{group.where[group.place[k]]}",
                value=float(group.value[k]),
                lower=float(group.lower[k]),
                upper=float(group.upper[k]),
                unit=group.unit,
            )
            for group in leaves.pruned
            for k in np.flatnonzero(
                (group.frame >= self.index) & (group.frame < self.index + self.hypotheses)
            )
        ]


@dataclass(frozen=True, kw_only=True)
class Recovery(Pictured):
    """All frames of a view.

    Parameters
    ----------
    figure : Figure
        The person's figure.
    fit : CameraFit
        The camera, and where it sees the root.
    frames : list of FrameRecovery
        In the view's order.
    settings : mapping
        Everything that decided the result.
    grower : Grower, optional
        What grew the trees: it can tell what would have admitted a posture (`posekit.recovery.least_violation`).
    up : Up
        Which way is up in the camera's frame.
    """

    figure: Figure
    fit: CameraFit
    frames: list[FrameRecovery]
    settings: Mapping[str, Any]
    grower: Grower | None = None
    up: Up = field(default_factory=Up.level)

    @property
    def unrecovered(self) -> dict[str, list[int]]:
        """Frames in which nothing was grown, counted from zero, by the reason."""
        found: dict[str, list[int]] = {}
        for k, frame in enumerate(self.frames):
            if frame.reason:
                found.setdefault(re.sub(r"^frames\[\d+\]: ", "", frame.reason), []).append(k)
        return found

    @property
    def pruned_count(self) -> int:
        """How many branches were pruned of all trees: what `FrameRecovery.pruned` lists of each frame."""
        batches = {id(frame.batch): frame.batch for frame in self.frames if frame.batch is not None}
        return sum(len(group.frame) for batch in batches.values() for group in batch.leaves.pruned)

    @cached_property
    def ranking(self) -> Ranking:
        """The probability of every survivor of every frame (`posekit.ranking.rank`)."""
        spread = [frame.spread for frame in self.frames]
        return ranked(self.frames, self.figure.lengths, spread, self.up)

    @cached_property
    def probability(self) -> list[Array]:
        """The probability of the survivors of each frame."""
        return np.split(self.ranking.probability, np.cumsum([len(frame) for frame in self.frames])[:-1])

    @cached_property
    def answers(self) -> list[Answer]:
        """What is to be said of each frame: its likeliest posture, how sure it is, and what else it can be."""
        from posekit.recovery.answered import answered

        return answered(self.frames, self.probability, [frame.spread for frame in self.frames])

    def show(self, view: View | None = None, path: str | Path | None = None) -> ShownPage:
        """Show the page of all survivors: in the notebook, or in the browser.

        Parameters
        ----------
        view : View, optional
            What was recovered: the page then shows the image, too.
        path : path, optional
            Where the page is written; one of the temporary files that are kept if not given (`posekit.viewer.showing`).

        Raises
        ------
        PosekitError
            Where there is no posture, or too many for one page.
        """
        from posekit.recovery.showing import show_recovery

        return show_recovery(self, view, path)

    def save(self, path: str | Path) -> None:
        """Write the result, as `posekit recover -o` does.

        Parameters
        ----------
        path : path
            ``.json``, ``.json.gz``, ``.npz`` or ``.parquet``.

        Raises
        ------
        InputError
            Where the name is none of these, or the file cannot be written.
        """
        from posekit.recovery.result import result_of
        from posekit.recovery.result_output import write_result

        write_result(path, result_of(self))

    def _facts(self) -> list[str]:
        counts = [len(frame) for frame in self.frames]
        none = f", none in {counts.count(0)}" if 0 in counts else ""
        facts = [plural(len(counts), "frame"), f"{plural(sum(counts), 'posture')}{none}"]
        return [*facts, f"ranges={self.settings['ranges']!r}"] if "ranges" in self.settings else facts

    def _drawing(self) -> str:
        answer = next((one for one in self.answers if len(one)), None)
        return "" if answer is None else posture_drawing(answer.joints[:MAX_DRAWN], CAMERA_UP)
