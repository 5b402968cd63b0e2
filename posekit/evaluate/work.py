"""A piece of an evaluation: some frames of one person at one level of noise, recovered and measured."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure
from posekit.evaluate.followed_sequences import chosen_by
from posekit.evaluate.joint_errors import best_of_frames, best_rows, of_chosen, survivor_errors
from posekit.evaluate.method import Method, figure_of
from posekit.evaluate.survivor_certificate import SurvivorCertificate, certify
from posekit.evaluate.survivor_order import SurvivorOrder, first_ranked
from posekit.evaluate.true_branch import killers, limbs_right, true_branch
from posekit.formats.own import ScaledOrthographicModel, View
from posekit.geometry import Array
from posekit.recovery.body import FigureBody, ranges_of
from posekit.recovery.recovery import FrameRecovery
from posekit.recovery.trees import Batch
from posekit.settings import Tolerance
from posekit.skeleton import JOINTS

SURVIVOR_ROLES: Final = ("best", "first", "random", "path")
"""Whose errors are told: the best survivor by each measure, the one that is ranked first, one drawn by lot, and the one
that was chosen by following the sequence, or what bridges it there."""

MAX_CERTIFIED_SURVIVORS: Final = 16
"""Survivors of a frame that are certified: evenly over them, all where there are no more."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Work:
    """Some frames, with their truth.

    Parameters
    ----------
    view : View
        What is seen, with noise, and the truth.
    clip : int
        The number of the clip that they are of.
    noise : float
        Standard deviation, pixels.
    frame : int array (F,)
        Each frame's number in the file.
    yaw, height : array (F,)
        Of each frame's camera, degrees and metres; NaN for a view.
    camera : int array (F,)
        Whose frames are a sequence together, in order.
    seed : tuple of int
        What the lots are drawn with.
    """

    view: View
    clip: int
    noise: float
    frame: NDArray[np.intp]
    yaw: Array
    height: Array
    camera: NDArray[np.intp]
    seed: tuple[int, ...]

    def __len__(self) -> int:
        """Count the frames."""
        return len(self.view)


@dataclass(frozen=True, kw_only=True, eq=False)
class Measured:
    """What was found of F frames.

    Parameters
    ----------
    survivors : int array (F,)
        How many postures were found.
    errors : mapping of str to array (F, 5)
        By `ROLES`: `posekit.evaluate.joint_errors.ERROR_NAMES`, metres.
    branch : array (F,)
        1 where a survivor has the truth's branch code, 0 where none has, NaN where the truth has none to be known.
    limbs : mapping of str to array (F,)
        By role, the best by its mean joint error: the share of the four limbs that take the true branch.
    bridged : array (F,)
        1 where the path passes the frame over, 0 where it takes a survivor, NaN where sequences are not followed.
    probability : array (F,)
        Of the first-ranked survivor; NaN where none is given.
    first_branch : array (F,)
        1 where the first-ranked survivor has the truth's code, 0 where not, NaN as above.
    certified : mapping of str to int array (F,)
        How many survivors were certified (``all``), and how many of them break the person's ``lengths``, and the
        ``ranges``.
    excess : mapping of str to array (F,)
        The worst of them (`SurvivorCertificate`): ``length``, metres; ``angle`` and ``turned``, degrees.
    killer : list of str
        What pruned the true branch.
    reason : list of str
        Why nothing was recovered.
    """

    survivors: NDArray[np.intp]
    errors: dict[str, Array]
    branch: Array
    limbs: dict[str, Array]
    bridged: Array
    probability: Array
    first_branch: Array
    certified: dict[str, NDArray[np.intp]]
    excess: dict[str, Array]
    killer: list[str]
    reason: list[str]


def measure(work: Work, method: Method) -> Measured:
    """Recover the frames and compare every survivor with the truth.

    Raises
    ------
    InputError
        Where the ranking or the choice through the sequence is not of the survivors.
    """
    frames = method.recover(work.view)
    figure = figure_of(work.view)
    counts = np.array([len(frame) for frame in frames], dtype=np.intp)
    offsets = np.concatenate([[0], np.cumsum(counts)])
    joints = np.concatenate([frame.joints for frame in frames])
    which = np.repeat(np.arange(len(frames)), counts)
    errors = survivor_errors(joints, work.view.truth[which])
    rankings = method.rank(frames, figure)
    first, probability = first_ranked(rankings, counts)
    path, along = _followed(work, method, frames, rankings)
    followed = survivor_errors(along, work.view.truth)
    if isinstance(work.view.camera, ScaledOrthographicModel):
        for found in (errors, followed):
            found[:, [0, 3]] = found[:, [1, 4]]  # it tells no place in space
    chosen = {
        "best": best_rows(errors[:, 0], offsets),
        "first": first,
        "random": _drawn(counts, np.random.default_rng((*work.seed, 1))),
        "path": path,
    }
    true, retained, killer = _true_codes(frames, work.view.truth)
    codes = np.array([int(code, 2) for frame in frames for code in frame.branches], dtype=np.int32)
    of_frame = {role: np.where(rows >= 0, _taken(codes, offsets, rows), -1) for role, rows in chosen.items()}
    if (np.isfinite(along).all(axis=(1, 2)) & (path < 0)).any():
        of_frame["path"] = np.where(path >= 0, of_frame["path"], _true_codes(frames, along)[0])
    known = np.isfinite(retained)
    certified, excess = _certified(frames, figure, method)
    first_branch = np.where(known, (of_frame["first"] == true) & (true >= 0) & (first >= 0), np.nan)
    return Measured(
        survivors=counts,
        errors={
            **{role: of_chosen(errors, offsets, rows) for role, rows in chosen.items()},
            "best": best_of_frames(errors, offsets),
            "path": np.where(np.isnan(followed), of_chosen(errors, offsets, path), followed),
        },
        branch=retained,
        limbs={
            role: np.where(known & (of_frame[role] >= 0), limbs_right(of_frame[role], true), np.nan)
            for role in chosen
        },
        bridged=np.full(len(frames), np.nan) if method.choose is None else (path < 0).astype(np.float64),
        probability=probability,
        first_branch=first_branch,
        certified=certified,
        excess=excess,
        killer=killer,
        reason=[frame.reason for frame in frames],
    )


def _taken(
    codes: NDArray[np.int32], offsets: NDArray[np.intp], chosen: NDArray[np.intp]
) -> NDArray[np.int32]:
    """Return the codes of one survivor a frame; anything where none was chosen."""
    if not len(codes):
        return np.full(len(chosen), -1, dtype=np.int32)
    return codes[np.minimum(offsets[:-1] + np.maximum(chosen, 0), len(codes) - 1)]


def _drawn(counts: NDArray[np.intp], rng: np.random.Generator) -> NDArray[np.intp]:
    """Draw one survivor a frame; -1 where there is none."""
    lots = (rng.random(len(counts)) * counts).astype(np.intp)
    return np.where(counts > 0, np.minimum(lots, counts - 1), -1)


def _followed(
    work: Work, method: Method, frames: Sequence[FrameRecovery], rankings: Sequence[SurvivorOrder]
) -> tuple[NDArray[np.intp], Array]:
    """Let each camera's frames be followed in order: survivors (F,), and where the person is then (F, 14, 3)."""
    chosen = np.full(len(frames), -1, dtype=np.intp)
    along = np.full((len(frames), len(JOINTS), 3), np.nan)
    if method.choose is not None:
        for camera in np.unique(work.camera):
            rows = np.flatnonzero(work.camera == camera)
            own = rows.tolist()
            chosen[rows], along[rows] = chosen_by(
                method.choose, [frames[k] for k in own], [rankings[k] for k in own]
            )
    return chosen, along


def _batches(frames: Sequence[FrameRecovery]) -> Iterator[tuple[Batch, NDArray[np.intp]]]:
    """Yield the batches that frames were grown in, with the frames of each."""
    grown = {id(frame.batch): frame.batch for frame in frames}
    for key, batch in grown.items():
        if batch is not None:
            yield batch, np.array([k for k, frame in enumerate(frames) if id(frame.batch) == key])


def _true_codes(frames: Sequence[FrameRecovery], truth: Array) -> tuple[NDArray[np.int32], Array, list[str]]:
    """Return each frame's true code (-1: none), whether a survivor has it (NaN: nobody knows), and what pruned it.

    Of several hypotheses one that has a survivor with its own true code is enough; without any, the first tells.
    """
    code = np.full(len(frames), -1, dtype=np.int32)
    retained = np.where(np.isfinite(truth).all(axis=(1, 2)), 0.0, np.nan)
    killer = [""] * len(frames)
    for batch, rows in _batches(frames):
        leaves = batch.leaves
        if not isinstance(batch.body, FigureBody):
            retained[rows] = np.nan
            continue
        owner = np.full(leaves.n_frames, -1, dtype=np.intp)
        for k in rows.tolist():
            owner[frames[k].index : frames[k].index + frames[k].hypotheses] = k
        mine = np.flatnonzero(owner >= 0)
        laid = np.full((leaves.n_frames, *truth.shape[1:]), np.nan)
        laid[mine] = truth[owner[mine]]
        true = true_branch(leaves, laid)
        alive = np.zeros(leaves.n_frames, dtype=np.bool_)
        alive[leaves.frame[leaves.code == true.code[leaves.frame]]] = True
        why = killers(leaves, true)
        for hypothesis in mine[::-1].tolist():  # the first is told last, and stays
            k = int(owner[hypothesis])
            if retained[k] == 1 and not alive[hypothesis]:
                continue
            code[k], killer[k] = true.code[hypothesis], "" if alive[hypothesis] else why[hypothesis]
            retained[k] = float(alive[hypothesis]) if true.known[hypothesis] else np.nan
    unplaced = np.array([frame.batch is None for frame in frames], dtype=np.bool_)
    for k in np.flatnonzero(unplaced & ~np.isnan(retained)).tolist():
        killer[k] = frames[k].lost_to
    return code, retained, killer


def _certified(
    frames: Sequence[FrameRecovery], figure: Figure, method: Method
) -> tuple[dict[str, NDArray[np.intp]], dict[str, Array]]:
    """Certify some survivors of every frame."""
    asked = method.settings
    ranges = ranges_of(asked) if "joint-range" in asked.check_names else None
    count = {name: np.zeros(len(frames), dtype=np.intp) for name in ("all", "lengths", "ranges")}
    worst = {name: np.full(len(frames), np.nan) for name in SurvivorCertificate._fields}
    by_tolerance: dict[Tolerance, list[int]] = {}
    for k, frame in enumerate(frames):
        if frame.tolerance is not None and len(frame):
            by_tolerance.setdefault(frame.tolerance, []).append(k)
    for tolerance, rows in by_tolerance.items():
        taken = [_evenly(len(frames[k])) for k in rows]
        joints = np.concatenate([frames[k].joints[some] for k, some in zip(rows, taken, strict=True)])
        found = certify(joints, figure, ranges, tolerance)
        starts = np.cumsum([0, *(len(some) for some in taken[:-1])])
        count["all"][rows] = [len(some) for some in taken]
        for name, broken in zip(("lengths", "ranges"), found.violations, strict=True):
            count[name][rows] = np.add.reduceat(broken.astype(np.intp), starts)
        for name, values in zip(worst, found, strict=True):
            worst[name][rows] = np.fmax.reduceat(values, starts)
    return count, worst


def _evenly(count: int) -> NDArray[np.intp]:
    places: NDArray[np.intp] = np.unique(
        np.linspace(0, count - 1, min(count, MAX_CERTIFIED_SURVIVORS)).astype(np.intp)
    )
    return places
