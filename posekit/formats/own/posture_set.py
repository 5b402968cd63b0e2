"""The complete set of one frame as what it is made of: trunks, the limbs of each, and which exclude each other.

A few trunks with a few alternatives of four limbs each stand for hundreds of whole bodies: `PostureSet.compose` lists
them.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from posekit.display.short_repr import ShortRepr
from posekit.formats.own.column import column, columns_in
from posekit.geometry import Array
from posekit.safe_io.refusal import refusal
from posekit.skeleton import LIMB_JOINTS, N_TRUNK_JOINTS
from posekit.tree.distinct import equal_pairs
from posekit.tree.factors import Rows, factor_postures, whole_bodies


@dataclass(frozen=True, kw_only=True, eq=False)
class PostureSet(ShortRepr):
    """T trunks and the L limbs that they can have, from 0.

    A whole body is a trunk with one limb of each kind, all on that trunk, of which no two exclude each other.

    Parameters
    ----------
    trunks : array (T, 6, 3)
        The joints of torso and hips in tree order, camera frame, metres; NaN where a joint is not known.
    trunk_chi2 : array (T,)
        Sum of squares of what is off over its standard deviations; NaN for exact frames.
    limb_trunk : int array (L,)
        The trunk of each limb.
    limb_kind : int array (L,)
        0 right arm, 1 left arm, 2 right leg, 3 left leg, as `posekit.skeleton.LIMB_JOINTS`.
    limb_joints : array (L, 2, 3)
        Elbow and wrist, or knee and ankle, camera frame, metres; NaN where a joint is not known.
    limb_chi2 : array (L,)
        What each limb adds to its trunk's chi2; NaN for exact frames.
    excluded : int array (E, 2)
        Pairs of limbs of one trunk that no body has both of, the lower first.
    bodies : int
        How many whole bodies `compose` lists. Where a check reads three limbs or more, not all of them pass it: it is
        an upper bound then.
    """

    schema_title: ClassVar = (
        "ResultSet",
        "The complete set of a frame: trunks, and the limbs that each can have.",
    )

    trunks: Array = column(
        "Neck, shoulders, pelvis and hips of each trunk, OpenCV camera frame, in `unit`; null where not known.",
        shape=(N_TRUNK_JOINTS, 3),
        length_power=1,
        decimals=0,
        null="row",
    )
    trunk_chi2: Array = column(
        "Of each trunk, where the noise is known: sum of squares of what is off over its standard deviations.",
        decimals=-1,
        null="number",
    )
    limb_trunk: Rows = column("The trunk of each limb, from 0.", kind="int")
    limb_kind: Rows = column(
        "What each limb is: 0 right arm, 1 left arm, 2 right leg, 3 left leg.", kind="int"
    )
    limb_joints: Array = column(
        "Elbow and wrist, or knee and ankle, of each limb, in `unit`; null where not known.",
        shape=(2, 3),
        length_power=1,
        decimals=0,
        null="row",
    )
    limb_chi2: Array = column(
        "What each limb adds to its trunk's chi2, where the noise is known.", decimals=-1, null="number"
    )
    excluded: Rows = column("Pairs of limbs of one trunk that no body has both of.", shape=(2,), kind="int")
    bodies: int = column(
        "How many whole bodies that makes: a trunk with one limb of each kind, of which no two exclude each other.",
        kind="int",
        once=True,
    )

    def __post_init__(self) -> None:
        T, L, E = len(self.trunks), len(self.limb_trunk), len(self.excluded)
        shapes: dict[str, tuple[int, ...]] = {
            "trunks": (T, N_TRUNK_JOINTS, 3),
            "trunk_chi2": (T,),
            "limb_trunk": (L,),
            "limb_kind": (L,),
            "limb_joints": (L, 2, 3),
            "limb_chi2": (L,),
            "excluded": (E, 2),
        }
        for name, each in columns_in(PostureSet).items():
            if each.once:
                continue
            values: NDArray[Any] = np.array(
                getattr(self, name), dtype=np.intp if each.kind == "int" else np.float64
            )
            if values.shape != shapes[name]:
                raise _refused(name, f"shape {values.shape}", f"shape {shapes[name]}")
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        for name, bound in (("limb_trunk", T), ("limb_kind", len(LIMB_JOINTS)), ("excluded", L)):
            values = getattr(self, name)
            if (values < 0).any() or (values >= bound).any():
                raise _refused(name, f"{values.min()} to {values.max()}", f"0 to {bound - 1}")
        one, other = self.excluded.T
        apart = (self.limb_trunk[one] != self.limb_trunk[other]) | (
            self.limb_kind[one] == self.limb_kind[other]
        )
        if (apart | (one >= other)).any():
            raise _refused(
                "excluded", "another pair", "pairs of limbs of two kinds on one trunk, the lower first"
            )
        object.__setattr__(self, "bodies", int(self.bodies))
        if self.bodies < 0:
            raise _refused("bodies", str(self.bodies), "a count from 0")

    @staticmethod
    def of(joints: Array, trunk_chi2: Array | None = None, limb_chi2: Array | None = None) -> PostureSet:
        """Find the set of whole bodies (N, 14, 3), joints compared to the last bit.

        The set has all of them; it has others too where what they exclude takes three limbs or more to say. The chi2 of
        each body's trunk (N,) and of its limbs (4, N) may be known.
        """
        n = len(joints)
        factors = factor_postures(np.zeros(n, dtype=np.intp), np.asarray(joints, dtype=np.float64))
        trunk_order, trunk_of = _by_first(factors.trunk, factors.trunk_of)
        kinds = np.repeat(np.arange(len(LIMB_JOINTS)), [len(one) for one in factors.limb])
        member = np.concatenate(factors.limb)
        order = np.lexsort([member, kinds, trunk_of[member]])
        place = np.empty_like(order)
        place[order] = np.arange(len(order))
        begin = np.searchsorted(kinds, np.arange(len(LIMB_JOINTS)))
        limb_of = place[factors.limb_of + begin[:, None]]
        kinds, member = kinds[order], member[order]
        ends = np.array([limb[1:] for limb in LIMB_JOINTS])
        found = PostureSet(
            trunks=joints[trunk_order, :N_TRUNK_JOINTS],
            trunk_chi2=np.full(len(trunk_order), np.nan) if trunk_chi2 is None else trunk_chi2[trunk_order],
            limb_trunk=trunk_of[member],
            limb_kind=kinds,
            limb_joints=joints[member[:, None], ends[kinds]],
            limb_chi2=np.full(len(member), np.nan) if limb_chi2 is None else limb_chi2[kinds, member],
            excluded=_never_together(trunk_of[member], kinds, limb_of),
            bodies=0,
        )
        object.__setattr__(found, "bodies", len(found.compose()))
        return found

    def compose(self) -> Rows:
        """List the whole bodies (N, 5): the trunk of each, and its limbs by kind; in the order of these numbers."""
        limbs = len(self.limb_trunk)
        excluded = self.excluded[:, 0] * limbs + self.excluded[:, 1]
        bodies = np.arange(len(self.trunks))[:, None]
        for kind in range(len(LIMB_JOINTS)):
            own = np.flatnonzero(self.limb_kind == kind)
            row, limb = equal_pairs(bodies[:, 0], self.limb_trunk[own])
            bodies = np.column_stack([bodies[row], own[limb]])
            before, last = bodies[:, 1:-1], bodies[:, -1:]
            pairs = np.minimum(before, last) * limbs + np.maximum(before, last)
            bodies = bodies[~np.isin(pairs, excluded).any(axis=1)]
        return bodies

    def joints(self, bodies: Rows) -> Array:
        """Put bodies (N, 5) of `compose` together (N, 14, 3), camera frame, metres."""
        return whole_bodies(self.trunks, [self.limb_joints] * len(LIMB_JOINTS), bodies[:, 0], bodies[:, 1:].T)

    def chi2(self, bodies: Rows) -> Array:
        """Add up what trunks and limbs of bodies (N, 5) are off (N,)."""
        return np.asarray(self.trunk_chi2[bodies[:, 0]] + self.limb_chi2[bodies[:, 1:]].sum(axis=1))


def _by_first(first: Rows, which: Rows) -> tuple[Rows, Rows]:
    """Sort kinds by their first member; return these, and each member's kind."""
    order = np.argsort(first)
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    return first[order], place[which]


def _never_together(trunk: Rows, kind: Rows, limb_of: Rows) -> Rows:
    """List pairs of limbs of one trunk, of two kinds, that no body (4, N) has both of."""
    limbs = len(trunk)
    found = [np.empty(0, dtype=np.intp)]
    for a, b in combinations(range(len(LIMB_JOINTS)), 2):
        one, other = np.flatnonzero(kind == a), np.flatnonzero(kind == b)
        row, column = equal_pairs(trunk[one], trunk[other])
        possible = one[row] * limbs + other[column]
        found.append(possible[~np.isin(possible, limb_of[a] * limbs + limb_of[b])])
    return np.column_stack(np.divmod(np.sort(np.concatenate(found)), max(limbs, 1)))


def _refused(field: str, got: str, expected: str) -> Exception:
    return refusal("result", f"set.{field}", got, expected, "correct what made the set")
