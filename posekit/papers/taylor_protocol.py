"""Taylor's §3.2: hands, elbows and shoulders against the truth, flips given by hand or chosen."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.formats.markdown import table_lines
from posekit.geometry import Array
from posekit.measures import adjacent_segments, angle_disparity, best_of, rms_distance
from posekit.papers.taylor_survival import AT_ONCE
from posekit.papers.taylor_views import StudyPictures
from posekit.recovery.taylor_figure.completion import Completion, joint_checks, taylor_checks
from posekit.recovery.taylor_figure.human import Human
from posekit.settings import MEASURED_TOLERANCE, Tolerance
from posekit.tree import Leaves
from posekit.validators import Ranges, judge, load_ranges

MARKED_JOINTS = ("right_wrist", "right_elbow", "right_shoulder", "left_shoulder", "left_elbow", "left_wrist")
"""Where the actor of §3.2 wore markers: a chain of five segments, with four angles between them."""

MARKED_ANGLES = adjacent_segments([(k, k + 1) for k in range(5)])

PRINTED_ERRORS = {"rms": (3.76, 3.31), "angle": (5.27, 3.81)}
"""Mean and median over 11 photographs of one actor: cm after the best similarity, and degrees (§3.2)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Accuracy:
    """What one way to choose the flips gives, over F pictures.

    Parameters
    ----------
    flips : str
        The way.
    rms : array (F,)
        Metres, six points, after the similarity that aligns them best; NaN where nothing was left to choose.
    angles : array (F, 4)
        Disparity of the four angles, degrees.
    n : int array (F,)
        From how many the choice was made.
    right : array (F,)
        Whether the true flips were chosen, 0 or 1; between them where it is a matter of chance.
    """

    flips: str
    rms: Array
    angles: Array
    n: NDArray[np.int64]
    right: Array

    def __post_init__(self) -> None:
        for name in ("rms", "angles", "n", "right"):
            values = np.array(getattr(self, name))
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    @property
    def chosen(self) -> NDArray[np.bool_]:
        """Where there was something to choose (F,)."""
        return self.n > 0

    def row(self) -> list[str]:
        """Write the way, N, the shares of right choices and of none, RMS (cm) and angles (degrees)."""
        n = self.n[self.chosen]
        return [
            self.flips,
            "-" if not len(n) else "1" if (n == 1).all() else f"{np.median(n):g} ({n.mean():.1f})",
            f"{self.right.mean():.1%}",
            f"{(~self.chosen).mean():.1%}",
            *_mean_median(self.rms * 100),
            *_mean_median(self.angles),
        ]


TABLE_HEAD = (
    "flips",
    "N, median (mean)",
    "all flips true",
    "no survivor",
    "RMS, mean, cm",
    "median",
    "angles, mean, deg",
    "median",
)

PAPER_ROW = (
    "Taylor 2000, by hand (printed: 11 photographs, OptoTrak)",
    "1",
    "",
    "",
    *(f"{value:g}" for key in ("rms", "angle") for value in PRINTED_ERRORS[key]),
)


def accuracy_lines(table: Sequence[Accuracy]) -> list[str]:
    """Lay the table out in Markdown, the paper's own figures first."""
    return table_lines(TABLE_HEAD, [PAPER_ROW, *(one.row() for one in table)])


def accuracy(
    human: Human,
    seen: Iterable[StudyPictures],
    *,
    tolerance: Tolerance = MEASURED_TOLERANCE,
    ranges: Ranges | None = None,
) -> list[Accuracy]:
    """Measure the reconstruction by §3.2, with flips by hand and with flips that the checks choose.

    Parameters
    ----------
    human : Human
        Taylor's human: its points and segments.
    seen : iterable of StudyPictures
        The pictures, with the truth.
    tolerance : Tolerance
        What the checks allow.
    ranges : Ranges, optional
        The figure's own unless told otherwise.

    Returns
    -------
    list of Accuracy
        In this order: flips by hand; the best of the N survivors, which only the truth can tell; the survivor whose
        worst joint-range margin is largest; a survivor at random, as the mean over all of them; and, where the
        checks leave nothing, no answer.
    """
    table = ranges or load_ranges("urdf")
    parts: dict[str, list[_Answer]] = {}
    for pictures in seen:
        checks = taylor_checks(pictures.figure, human.points, ranges=table, tolerance=tolerance)
        for part in pictures.parts(AT_ONCE):
            every = human.grow(part.image, part.lengths, part.scale)
            true = human.code(every, part.truth)
            by_hand = _measure(human, every, part, np.flatnonzero(every.code == true[every.frame]))
            left = human.spanned.tree.prune(every, checks)
            survivors = _measure(human, left, part, np.arange(len(left.code)))
            margin = _margins(human, left, part, table, tolerance)
            for name, answer in (
                ("given by hand", _choose(by_hand, true, np.zeros(len(by_hand.frame)))),
                ("best of the N survivors", _choose(survivors, true, survivors.rms)),
                ("the survivor farthest inside its limits", _choose(survivors, true, -margin)),
                ("any survivor, on average", _average(survivors, true)),
            ):
                parts.setdefault(name, []).append(answer)
    return [
        Accuracy(
            flips=name,
            rms=np.concatenate([answer.rms for answer in answers]),
            angles=np.concatenate([answer.angles for answer in answers]),
            n=np.concatenate([answer.n for answer in answers]),
            right=np.concatenate([answer.right for answer in answers]),
        )
        for name, answers in parts.items()
    ]


class _Answer(NamedTuple):
    """What one way to choose gives in some pictures: see `Accuracy`."""

    rms: Array
    angles: Array
    n: NDArray[np.int64]
    right: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class _Measured:
    """Errors of N postures in F pictures, sorted by picture."""

    count: int
    frame: NDArray[np.int32]
    code: NDArray[np.int32]
    rms: Array
    angles: Array


def _measure(human: Human, leaves: Leaves, part: StudyPictures, rows: NDArray[np.intp]) -> _Measured:
    six = [human.linkage.points.index(name) for name in MARKED_JOINTS]
    frame = leaves.frame[rows]
    ours = human.twelve(leaves.positions(range(len(human.points)), rows))[:, six]
    theirs = part.truth[frame][:, six]
    return _Measured(
        count=len(part),
        frame=frame,
        code=leaves.code[rows],
        rms=rms_distance(ours, theirs).value,
        angles=angle_disparity(ours, theirs, MARKED_ANGLES).degrees,
    )


def _choose(measured: _Measured, true: NDArray[np.int32], cost: Array) -> _Answer:
    """Choose in each picture the answer of least cost."""
    rms, angles = np.full(measured.count, np.nan), np.full((measured.count, len(MARKED_ANGLES)), np.nan)
    n, right = np.zeros(measured.count, dtype=np.int64), np.zeros(measured.count)
    for frame in range(measured.count):
        rows = np.flatnonzero(measured.frame == frame)
        if not len(rows):
            continue
        best = best_of(np.nan_to_num(cost[rows], nan=np.inf))
        row = rows[best.index]
        rms[frame], angles[frame], n[frame] = measured.rms[row], measured.angles[row], best.n
        right[frame] = measured.code[row] == true[frame]
    return _Answer(rms, angles, n, right)


def _average(measured: _Measured, true: NDArray[np.int32]) -> _Answer:
    """Take the mean error over all answers of each picture."""
    n = np.bincount(measured.frame, minlength=measured.count)
    share = np.where(n > 0, 1.0 / np.maximum(n, 1), np.nan)

    def mean(values: Array) -> Array:
        return np.asarray(share * np.bincount(measured.frame, values, minlength=measured.count))

    right = mean((measured.code == true[measured.frame]).astype(np.float64))
    return _Answer(
        rms=mean(measured.rms),
        angles=np.stack([mean(column) for column in measured.angles.T], axis=1),
        n=n.astype(np.int64),
        right=np.nan_to_num(right),
    )


def _margins(human: Human, left: Leaves, part: StudyPictures, ranges: Ranges, tolerance: Tolerance) -> Array:
    """Return the worst joint-range margin (N,) of each survivor, degrees; NaN where nothing was decided."""
    if not len(left.code):
        return np.empty(0)
    completion = Completion(figure=part.figure, points=human.points)
    joints = completion.complete(left.postures())
    checks = joint_checks(part.figure, ("joint-range",), ranges=ranges, tolerance=tolerance)
    (judgement,) = judge(checks, joints)
    return judgement.worst


def _mean_median(values: Array) -> tuple[str, str]:
    known = values[np.isfinite(values)]
    return (f"{known.mean():.2f}", f"{np.median(known):.2f}") if len(known) else ("-", "-")
