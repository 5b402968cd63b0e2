"""The validator of any robot's postures: a model with their lengths, a fit, the checks that were asked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.robots import Robot, check_configurations
from posekit.robots.joint_map import targets_of
from posekit.robots.scaling import segment_lengths, shoulders_are_behind
from posekit.settings import ValidateSettings
from posekit.validators.robot.configurations import judge_quickly
from posekit.validators.robot.fitting import Fit
from posekit.validators.robot.joint_range import judge_joint_range
from posekit.validators.robot.models import JudgedModel, Models
from posekit.validators.robot.reach import judge_reach
from posekit.validators.robot.rigid_parts import judge_rigid_parts
from posekit.validators.robot.settings import OF_POSITIONS, reach_tolerance
from posekit.validators.suite import Judgement

CLEAR_DEGREES: Final = 0.5
"""Degrees that a fit without limits must be outside one, beyond the tolerance, to be a violation."""

CLEAR_A_METRE: Final = 100.0
"""Degrees more for each metre of misfit: a centimetre turns a segment of 57 cm by one."""

CLEAR_COST: Final = 1e-3
"""Metres by which limits must keep a posture off to be called violated: the search may miss by less."""

Bools = NDArray[np.bool_]


class Verdict(NamedTuple):
    """What is said about N postures.

    Attributes
    ----------
    judgements : sequence of Judgement
        What each check says, a row a configuration.
    complete : bool array (N,)
        Whether all joints that the model has are known.
    q : array (N, nq)
        The configurations that were judged.
    points : tuple of str
        The P points that were compared; none where configurations were given.
    residual : array (N, P)
        Distances of the configurations' points from the postures', metres.
    models : list of Judged
        The model that was judged: one for all, or one a posture.
    """

    judgements: Sequence[Judgement]
    complete: Bools
    q: Array
    points: tuple[str, ...]
    residual: Array
    models: list[JudgedModel]


@dataclass(frozen=True, kw_only=True, eq=False)
class RobotValidator:
    """Judges postures, or configurations, of any robot.

    Parameters
    ----------
    robot : Robot
        The robot that is judged, as it was loaded.
    settings : ValidateSettings
        What the judging was asked.
    """

    robot: Robot
    settings: ValidateSettings

    @cached_property
    def models(self) -> Models:
        """The robot's models, made when they are needed."""
        return Models(robot=self.robot, settings=self.settings)

    def judge_configurations(self, q: ArrayLike, source: str = "q") -> Verdict:
        """Judge configurations (N, nq) as they are.

        Raises
        ------
        InputError
            Where they are none of the robot's (`check_configurations`), or no check is left to judge them.
        """
        checked = check_configurations(self.robot.model, q, source)
        checked.flags.writeable = False  # its margins may be asked for later
        asked = set(self.settings.check_names)
        if asked and not asked - set(OF_POSITIONS):
            raise InputError(
                f"--checks: {', '.join(self.settings.check_names)}: a configuration's lengths are the model's own, so "
                "nothing would be judged; expected joint-range, collision or balance"
            )
        return Verdict(
            judgements=_of_configurations(self.models.own, checked),
            complete=np.ones(len(checked), dtype=np.bool_),
            q=checked,
            points=(),
            residual=np.zeros((len(checked), 0)),
            models=[self.models.own],
        )

    def judge_postures(
        self,
        postures: Array,
        *,
        sequence: NDArray[np.intp] | None = None,
        lengths: Mapping[str, float] | None = None,
        behind: bool | None = None,
    ) -> Verdict:
        """Judge joint positions (N, 14, 3), or (N, 19, 3) with the head's points, metres; NaN is unknown.

        Parameters
        ----------
        postures : array
            Joint positions (N, J, 3), metres; NaN where a joint is not known.
        sequence : int array (N,), optional
            Which sequence in time each belongs to; then a fit starts from the one before.
        lengths : mapping, optional
            Segment lengths, metres; those of the postures unless told otherwise.
        behind : bool, optional
            On which side of the trunk the shoulders lie; seen in the postures unless told otherwise.
        """
        if self.settings.lengths == "each" and len(postures) > 1:
            rows = range(len(postures))
            return _joined([self.judge_postures(postures[k : k + 1]) for k in rows])
        judged = self._model_for(postures, lengths, behind)
        kinematics, settings = judged.fitter.kinematics, self.settings
        targets = targets_of(postures, kinematics)
        fit = judged.fitter.fit(targets, sequence)
        known = np.asarray(np.isfinite(targets).all(axis=(1, 2)))
        judgements: list[Judgement] = []
        if "reach" in settings.check_names:
            judgements.append(
                judge_reach(kinematics, targets, fit.judged_residual, tolerance=reach_tolerance(settings))
            )
        if "rigid-parts" in settings.check_names:
            judgements.append(judge_rigid_parts(kinematics, targets, tolerance=settings.rigid))
        judgements += _of_fits(judged, fit, seen=judged.fitter.seen(targets), complete=known)
        return Verdict(judgements, known, fit.judged_q, kinematics.names, fit.judged_residual, [judged])

    def _model_for(
        self, postures: Array, lengths: Mapping[str, float] | None, behind: bool | None
    ) -> JudgedModel:
        if self.settings.lengths == "model":
            return self.models.mapped
        lengths = segment_lengths(postures) if lengths is None else lengths
        if self.models.has_lengths(lengths):
            return self.models.mapped
        possible = self.models.possible(lengths)
        if len(possible) < len(lengths) and (self.settings.lengths == "each" or not any(lengths.values())):
            return self.models.mapped  # no body: its rigid parts say so
        # Of some that are impossible, rigid parts say it; where all are, it is another unit, and that is refused.
        return self.models.with_lengths(
            possible or lengths, shoulders_are_behind(postures) if behind is None else behind
        )


def _of_configurations(judged: JudgedModel, q: Array) -> Sequence[Judgement]:
    """Ask the checks of configurations; balance, which costs the forward kinematics, has no quick verdict."""
    settings = judged.settings
    judgements = judge_quickly(
        judged.subject,
        judged.collision if "collision" in settings.check_names else None,
        q,
        tolerance=settings.angle if "joint-range" in settings.check_names else None,
    )
    if "balance" in settings.check_names:
        return [*judgements, judged.balance.judge(q)]
    return judgements


def _of_fits(judged: JudgedModel, fit: Fit, *, seen: Bools, complete: Bools) -> list[Judgement]:
    """Ask the same checks of what was fitted to postures: nothing is said of a fit that is not near its posture."""
    settings, judgements = judged.settings, []
    residual = fit.judged_residual
    misfit = np.where(np.isfinite(residual), residual, 0.0).max(axis=1, initial=0.0)
    far = misfit > reach_tolerance(settings)
    if "joint-range" in settings.check_names:
        judgements.append(
            judge_joint_range(
                judged.subject,
                fit.judged_q,
                tolerance=settings.angle,
                seen=seen,
                undecided=far,
                slack=np.where(
                    fit.kept_off > CLEAR_COST,
                    CLEAR_DEGREES + CLEAR_A_METRE * misfit,
                    np.where(fit.suffers, np.inf, 0.0),
                ),
            )
        )
    if "collision" in settings.check_names:
        judgements.append(judged.collision.judge(fit.judged_q, far | ~complete))
    if "balance" in settings.check_names:
        judgements.append(judged.balance.judge(fit.judged_q, far | ~complete))
    return judgements


def _joined(parts: list[Verdict]) -> Verdict:
    """Put the verdicts on single postures together."""
    judgements = []
    for k, first in enumerate(parts[0].judgements):
        numbers: dict[str, Any] = {
            name: np.concatenate([getattr(part.judgements[k], name) for part in parts])
            for name in ("value", "lower", "upper", "margin", "violated")
        }
        judgements.append(replace(first, **numbers))
    return Verdict(
        judgements=judgements,
        complete=np.concatenate([part.complete for part in parts]),
        q=np.concatenate([part.q for part in parts]),
        points=parts[0].points,
        residual=np.concatenate([part.residual for part in parts]),
        models=[part.models[0] for part in parts],
    )
