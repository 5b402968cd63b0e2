"""What a validator returns: arrays over the postures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from posekit.display.plural import plural
from posekit.display.short_repr import ShortRepr
from posekit.geometry import Array
from posekit.validators.robot.collision import SelfCollision
from posekit.validators.robot.contacts import Contacts
from posekit.validators.robot.deferred import Deferred
from posekit.validators.robot.subject import CENTIMETRES_A_DEGREE
from posekit.validators.suite import Judgement

VERDICT_WORDS = ("valid", "invalid", "undecided")


@dataclass(frozen=True, kw_only=True, eq=False)
class Report(ShortRepr):
    """Verdicts on N postures, with the findings behind them.

    Parameters
    ----------
    judgements : sequence of Judgement
        By validator; of configurations each is made when it is looked at.
    complete : bool array (N,)
        Whether all joints that the model has are known.
    q : array (N, nq)
        The configuration of each posture.
    fk_distance : array (N,)
        Distance between the posture and its configuration, metres: the largest over the joints.
    points : tuple of str
        The P points of a robot that were fitted to the posture's; none of a figure, or where q was given.
    residual : array (N, P)
        The distance of each from the posture's, metres; NaN where the posture's is unknown.
    colliders : tuple of SelfCollision
        Who knows which bodies touch: one for all postures, or one a posture.
    """

    judgements: Sequence[Judgement]
    complete: NDArray[np.bool_]
    q: Array
    fk_distance: Array
    points: tuple[str, ...] = ()
    residual: Array = field(default_factory=lambda: np.zeros((0, 0)))
    colliders: tuple[SelfCollision, ...] = ()

    def _facts(self) -> list[str]:
        found = [(int(getattr(self, word).sum()), word) for word in VERDICT_WORDS]
        return [plural(len(self.complete), "posture"), *[f"{count} {word}" for count, word in found]]

    @cached_property
    def invalid(self) -> NDArray[np.bool_]:
        """Postures that some check rejects (N,)."""
        if isinstance(self.judgements, Deferred):
            return self.judgements.rejected
        invalid = np.zeros(len(self.complete), dtype=bool)
        for judgement in self.judgements:
            invalid |= judgement.violated.any(axis=1)
        return invalid

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Postures with all joints that no check rejects, and on which every check decided something (N,)."""
        return self._decided & ~self.invalid

    @property
    def undecided(self) -> NDArray[np.bool_]:
        """Postures that nothing rejects, but with unknown joints, or that some check could not judge at all (N,)."""
        return ~self._decided & ~self.invalid

    @cached_property
    def _decided(self) -> NDArray[np.bool_]:
        decided = self.complete.copy()
        for judgement in () if isinstance(self.judgements, Deferred) else self.judgements:
            if judgement.where and not judgement.over_time:  # a robot without limits is inside them
                decided &= ~np.isnan(judgement.worst)
        return decided

    @property
    def verdicts(self) -> list[str]:
        """``valid``, ``invalid`` or ``undecided``, a posture each."""
        number = np.where(self.invalid, 1, np.where(self._decided, 0, 2))
        return [VERDICT_WORDS[k] for k in number.tolist()]

    @cached_property
    def worst(self) -> Array:
        """The smallest margin of each posture over all checks (N,), degrees; a centimetre counts as one degree.

        NaN where nothing was decided.
        """
        worst = np.full(len(self.complete), np.nan)
        for judgement in self.judgements:
            if judgement.over_time:
                continue
            each = [1.0 if unit == "deg" else 1.0 / CENTIMETRES_A_DEGREE for unit in judgement.unit]
            worst = np.fmin(worst, np.fmin.reduce(judgement.margin * each, axis=1, initial=np.nan))
        return worst

    def of(self, part: slice) -> Report:
        """Return the verdicts on some of the postures, of a stick figure."""
        return replace(
            self,
            judgements=[judgement.of(part) for judgement in self.judgements],
            **{name: getattr(self, name)[part] for name in ("complete", "q", "fk_distance")},
        )

    def without(self, rows: NDArray[np.bool_]) -> Report:
        """Return the report with nothing decided of some postures (N,): another was judged in their place."""
        return replace(
            self,
            judgements=[judgement.without(rows) for judgement in self.judgements],
            complete=self.complete & ~rows,
            q=np.where(rows[:, None], np.nan, self.q),
            fk_distance=np.where(rows, np.nan, self.fk_distance),
        )

    def joined(self, judgements: Sequence[Judgement]) -> Report:
        """Return the report with further judgements of the same postures, as those of checks over time."""
        own = self.judgements
        together = own.joined(judgements) if isinstance(own, Deferred) else [*own, *judgements]
        return replace(self, judgements=together)

    def contacts(self, *, nearest: bool | NDArray[np.bool_] = False) -> Contacts:
        """List the pairs of bodies that collide in each posture, with their distances.

        Parameters
        ----------
        nearest : bool, or bool array (N,)
            List the nearest pair of postures without a collision too, of all or of some; with meshes that takes long.
        """
        # The last but balance: what comes before need not be made.
        judged = next((one for one in reversed(self.judgements) if one.by_pairs), None)
        if not self.colliders or judged is None:
            nothing = np.zeros(0, dtype=np.intp)
            return Contacts(
                posture=nothing, pair=nothing, distance=np.zeros(0), violated=nothing.astype(bool), names=()
            )
        rows = np.flatnonzero(judged.violated[:, 0] | (nearest & ~np.isnan(judged.value[:, 0])))
        some = bool(np.any(nearest))
        if len(self.colliders) == 1:
            return self.colliders[0].contacts(self.q, rows, nearest=some)
        parts = [self.colliders[row].contacts(self.q, np.array([row]), nearest=some) for row in rows.tolist()]
        return Contacts(
            posture=np.concatenate([part.posture for part in parts] or [np.zeros(0, dtype=np.intp)]),
            pair=np.concatenate([part.pair for part in parts] or [np.zeros(0, dtype=np.intp)]),
            distance=np.concatenate([part.distance for part in parts] or [np.zeros(0)]),
            violated=np.concatenate([part.violated for part in parts] or [np.zeros(0, dtype=bool)]),
            names=self.colliders[0].subject.pair_names,
        )
