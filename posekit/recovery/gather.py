"""Build a `Recovery` from postures: list the postures, compute their probabilities, and answer each frame."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure, with_head
from posekit.cameras import View
from posekit.geometry import Array, Flags, Ints
from posekit.ranking import softmax
from posekit.recovery.answer import answers_of, joint_radius
from posekit.recovery.recovery import Answer, Frames, Recovery, Survivors
from posekit.recovery.sight import Sight
from posekit.settings import RecoverSettings
from posekit.skeleton import JOINTS, SEGMENT_NAMES, SEGMENTS

#: Rejected leaves of a frame without a tree.
LOST: Final = {"root/not_known": 8192}

#: Difference in depth (metres) below which neither end of a segment is nearer.
LEVEL_METRES: Final = 1e-6


class Gathering:
    """Results of the frames of a view; a frame without a result is an open frame.

    Parameters
    ----------
    view : View
    sight : Sight
        Input of the search for postures.
    person : Figure
    settings : RecoverSettings
    nearer : int array (F, 17)
        Stated depth order of segments: 1 if the second end of a segment is farther from the camera, -1 if it is nearer,
        0 if the order is not stated.
    """

    def __init__(
        self, view: View, sight: Sight, person: Figure, settings: RecoverSettings, nearer: NDArray[np.int8]
    ) -> None:
        self.view, self.sight, self.person, self.settings, self.nearer = view, sight, person, settings, nearer
        self.lengths = np.array([person.lengths[name] for name in SEGMENT_NAMES])
        self.open = {k for k, reason in enumerate(sight.reasons) if not reason}
        frames = Frames(
            time=view.time,
            camera=sight.cameras,
            rejected=[LOST] * len(view),
            reason=[reason or "no posture fits" for reason in sight.reasons],
            root=sight.roots,
        )
        self.frames: dict[str, Any] = {name: list(values) for name, values in frames.columns().items()}
        self.answers: list[tuple[Ints, Callable[[], dict[str, Any]]]] = []
        self.survivors: list[Survivors] = []

    def close(self, *frames: int, **about: Any) -> None:
        """Set entries of the given frames in columns of `Frames`; the frames are no longer open."""
        for k in frames:
            for name, value in about.items():
                self.frames[name][k] = value
        self.open.difference_update(frames)

    def add(
        self,
        judged: str,
        lost: dict[int, dict[str, int]],
        columns: dict[str, Any],
        terms: Mapping[str, Array],
        reason: NDArray[np.str_],
        covariance: Callable[[Ints], Array] | None = None,
        *,
        leave: bool = False,
    ) -> None:
        """Add the postures that pass, sorted by frame and decreasing probability, and answer their frames.

        Parameters
        ----------
        judged : str
            The way the frames were judged, as in `Frames.judged`.
        lost : dict of int to dict
            For each frame, the number of branches rejected earlier, by reason.
        columns : dict of str to array
            Columns of `Survivors`, by frame.
        terms : mapping of str to array (N,)
            Terms whose sum is the logarithm of the unnormalised probability of each posture.
        reason : str array (N,)
            Reason why each posture fails; empty if it passes.
        covariance : callable, optional
            Maps rows (n,) of postures under noise to the covariances of their joints (n, 42, 42). If it is given, only
            the most probable postures, up to the setting `coverage`, are listed.
        leave : bool
            Whether frames without a passing posture stay open.
        """
        every, joints = columns["frame"], columns["joints"]
        if self.nearer.any():
            start, end = np.array(SEGMENTS).T
            ahead = (joints[:, end, 2] - joints[:, start, 2]) * self.nearer[every]
            reason = np.where((ahead < -LEVEL_METRES).any(axis=1) & (reason == ""), "nearer/given", reason)
        for row in np.flatnonzero(reason != "").tolist():
            own, name = lost[int(every[row])], str(reason[row])
            own[name] = own.get(name, 0) + 1
        rows = np.flatnonzero(reason == "")
        probability = softmax(np.sum(list(terms.values()), axis=0)[rows], every[rows])
        order = np.lexsort((-probability, every[rows]))
        rows, probability = rows[order], probability[order]
        frame = every[rows]
        first = np.searchsorted(frame, frame)
        before = np.cumsum(probability) - probability
        held = (before - before[first] < self.settings.coverage - 1e-12) | (covariance is None)
        held[first] = True
        unlisted = np.bincount(frame[~held], minlength=len(self.view))
        improbable = np.bincount(frame[~held], probability[~held], len(self.view)).astype(np.float64)
        passed = set(frame.tolist())
        found = np.array(sorted(passed), dtype=np.intp)
        for k in passed if leave else lost:
            why, about = "", {"unlisted": int(unlisted[k]), "unlisted_probability": improbable[k]}
            if k not in passed:
                worst = max(lost[k], key=lost[k].__getitem__, default="").replace("/", " at ")
                why = f"no posture passes: most fail {worst}"
            self.close(k, rejected=lost[k], judged=judged, reason=why, **about)
        if len(found):
            rows, probability = rows[held], probability[held]
            table = {name: values[rows] for name, values in columns.items()} | {"probability": probability}
            self._keep(found, table, None if covariance is None else covariance(rows), improbable[found])

    def _keep(self, found: Ints, table: dict[str, Any], covariance: Array | None, unlisted: Array) -> None:
        """Store the survivors of the frames `found` (K,); the answers of exact frames are computed at first access."""
        frame = np.searchsorted(found, table["frame"])
        starts = np.flatnonzero(np.diff(frame, prepend=-1))
        joints, probability = table["joints"], table["probability"]
        perspective = self.sight.camera.perspective
        relative = np.full(len(found), not perspective)
        if covariance is not None:
            block = covariance.reshape(-1, len(JOINTS), 3, len(JOINTS), 3)
            of_joint = np.einsum("njajb->njab", block)
            if perspective:
                relative = ~self.sight.given[found]
            else:
                # The position in space is unknown: radii are relative to the mean of the joints.
                with_mean = block.mean(axis=3)
                of_mean = with_mean.mean(axis=1, keepdims=True)
                of_joint = of_joint - with_mean - with_mean.swapaxes(2, 3) + of_mean
            table["radius"] = joint_radius(of_joint)
            weight = probability / np.add.reduceat(probability, starts)[frame]
            depth, own = joints[:, 0, 2], table["radius"][:, 0] / 1.96
            mean = np.add.reduceat(weight * depth, starts)
            spread = np.sqrt(np.add.reduceat(weight * ((depth - mean[frame]) ** 2 + own**2), starts))
            for row, k in enumerate(found.tolist()):
                if perspective and relative[row] and not self.frames["root"][k]:
                    estimate = {"estimate": float(mean[row]), "deviation": float(spread[row])}
                    self.frames["root"][k] = {"method": "solver", **estimate}
        if self.settings.group is not None:
            each = np.split(joints, starts[1:])
            table["group"] = np.concatenate([group_of(one, self.settings.group) for one in each])
        self.survivors.append(Survivors(**frozen(table)))
        answers: Callable[[], dict[str, Any]] = partial(
            answers_of, joints, frame, probability, covariance, self.lengths, relative, unlisted
        )
        # Covariances are not kept.
        self.answers.append((found, answers if covariance is None else partial(dict, answers())))

    def answer(self, starts: Ints) -> Answer:
        """Return the answers; `starts` (F,) are the rows of the first survivors of the frames."""
        nothing = Answer(joints=np.full((len(starts), len(JOINTS), 3), np.nan))
        columns: dict[str, Any] = {name: list(values) for name, values in nothing.columns().items()}
        for found, answers in self.answers:
            for name, values in answers().items():
                for row, k in enumerate(found.tolist()):
                    of_rows = name in ("survivor", "representatives")
                    columns[name][k] = values[row] + starts[k] if of_rows else values[row]
        return Answer(**columns)

    def recovery(
        self, margins: Callable[[Array, Flags], Mapping[str, Array]], **about: Mapping[str, Any]
    ) -> Recovery:
        """Return the result of all frames.

        Parameters
        ----------
        margins : callable
            Function of postures (N, 19, 3) and a mask (N,) of the postures found under noise; it returns their margins
            by check.
        **about
            ``settings`` and ``tolerances`` of the result.
        """
        if not self.survivors:
            self.survivors = [Survivors(frame=np.empty(0, np.intp), joints=np.empty((0, len(JOINTS), 3)))]
        view, parts = self.view, [one.columns() for one in self.survivors]
        table = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        if (np.diff(table["frame"]) < 0).any():
            order = np.argsort(table["frame"], kind="stable")
            table = {name: values[order] for name, values in table.items()}
        starts = np.searchsorted(table["frame"], np.arange(len(view)))
        points = partial(with_head, table["joints"], table["head"])
        return Recovery(
            survivors=Survivors(
                q=lambda: self.person.inverse_kinematics(points()),
                margins=lambda: margins(points(), table["chi2"] > 0),
                **frozen(table),
            ),
            frames=Frames(pictures=view.pictures, **self.frames),
            answer=partial(self.answer, starts),
            lengths=dict(self.person.lengths),
            configuration_names=self.person.configuration_names,
            unit=view.unit,
            camera=view.camera.fields("m"),
            source=view.source,
            **about,  # type: ignore[arg-type]
        )


def frozen(table: dict[str, Any]) -> dict[str, Any]:
    """Make the columns of a table read-only, so that they need not be copied."""
    for values in table.values():
        values.flags.writeable = False
    return table


def group_of(joints: Array, within: float) -> Ints:
    """Return the group of each posture (N, 14, 3); all its joints are `within` metres of the group's first posture."""
    group = np.full(len(joints), -1, dtype=np.intp)
    for k, leader in enumerate(joints):
        if group[k] < 0:
            apart = np.fmax.reduce(np.linalg.norm(joints - leader, axis=2), axis=1)
            group[(apart <= within) & (group < 0)] = group.max() + 1
    return group
