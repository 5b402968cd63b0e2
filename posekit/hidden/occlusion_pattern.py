"""What is known of a pattern of seen and hidden joints, and when each check can be asked."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property

from posekit.skeleton import HIPS, JOINT, JOINTS, SIDES, TORSO
from posekit.tree import Check


class JointState(IntEnum):
    """What is known of a joint in a survivor: its position, only its ray, or nothing."""

    EXACT = 0
    SEEN = 1
    HIDDEN = 2


@dataclass(frozen=True, kw_only=True)
class LimbChain:
    """Three joints in a row: the first on a rigid part, the others free."""

    base: int
    middle: int
    end: int

    @property
    def free(self) -> tuple[int, int]:
        """The two joints that are the limb's own."""
        return self.middle, self.end


LIMB_CHAINS = tuple(
    LimbChain(
        **{
            role: JOINT[f"{side}_{joint}"]
            for role, joint in zip(("base", "middle", "end"), names, strict=True)
        }
    )
    for names in (("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle"))
    for side in SIDES
)
TORSO_JOINTS = tuple(JOINT[name] for name in TORSO)
HIP_JOINTS = tuple(JOINT[name] for name in HIPS)
TRUNK_JOINTS = (*TORSO_JOINTS, *HIP_JOINTS[1:])


@dataclass(frozen=True, kw_only=True, eq=False)
class OcclusionPattern:
    """One pattern of seen and hidden joints.

    Checks fall into classes by the unknown joints that they read: those of the trunk (torso and hips), or of one
    limb as well, or of several. What reads only the trunk and limbs with unknown joints is judged once for all
    survivors that share those (`*_own`); what reads a limb that is known is judged for each survivor (`*_cross`).

    Parameters
    ----------
    states : tuple of JointState (14,)
        What is known of each joint, in tree order.
    checks : sequence of Check
        All that the survivors passed so far as they were decided.
    """

    states: tuple[JointState, ...]
    checks: Sequence[Check]

    @cached_property
    def unknown(self) -> tuple[int, ...]:
        """Joints without a position, in tree order."""
        return tuple(joint for joint, state in enumerate(self.states) if state != JointState.EXACT)

    @cached_property
    def trunk_joints(self) -> tuple[int, ...]:
        """Unknown joints of torso and hips."""
        return tuple(joint for joint in self.unknown if joint in TRUNK_JOINTS)

    @cached_property
    def limbs(self) -> tuple[LimbChain, ...]:
        """The limbs with unknown joints."""
        return tuple(limb for limb in LIMB_CHAINS if self.free(limb))

    def free(self, limb: LimbChain) -> tuple[int, ...]:
        """Return the unknown joints of a limb, those of its rigid part not among them."""
        return tuple(joint for joint in limb.free if self.states[joint] != JointState.EXACT)

    def hidden(self, limb: LimbChain) -> bool:
        """Whether a joint of the limb is hidden: else its positions are a few, each by a lift."""
        return any(self.states[joint] == JointState.HIDDEN for joint in limb.free)

    @cached_property
    def core(self) -> tuple[int, ...]:
        """The joints that decide what the hidden ones can do by themselves: known ones of trunk and open limbs."""
        wanted = (*TRUNK_JOINTS, *(joint for limb in self.limbs for joint in limb.free))
        return tuple(joint for joint in wanted if self.states[joint] == JointState.EXACT)

    @cached_property
    def relevant_checks(self) -> tuple[Check, ...]:
        """The checks that read an unknown joint."""
        return tuple(check for check in self.checks if self._reads(check))

    @cached_property
    def torso_own(self) -> list[Check]:
        """Checks that read unknown joints of the torso alone, and nothing beyond the trunk."""
        return [c for c in self._of((), cross=False) if self._reads(c) <= set(TORSO_JOINTS)]

    @cached_property
    def hips_own(self) -> list[Check]:
        """Checks of the trunk that must wait for the hips."""
        return [c for c in self._of((), cross=False) if not self._reads(c) <= set(TORSO_JOINTS)]

    def decided_by(self, joints: Collection[int], known: Collection[int]) -> list[Check]:
        """Return the trunk's checks that can be asked once some joints are known, others being `known` by then."""
        return [
            check
            for check in self._of((), cross=False)
            if not set(joints).isdisjoint(check.points) and self._reads(check) <= set(known)
        ]

    @cached_property
    def trunk_cross(self) -> list[Check]:
        """Checks of the trunk's unknown joints against limbs that are known."""
        return self._of((), cross=True)

    @cached_property
    def middle_own(self) -> dict[LimbChain, list[Check]]:
        """By limb: checks of its middle joint that can be asked before its end is placed."""
        return {
            limb: [c for c in self._of((limb,), cross=False) if limb.end not in self._reads(c)]
            for limb in self.limbs
        }

    @cached_property
    def end_own(self) -> dict[LimbChain, list[Check]]:
        """By limb: checks that wait for its end."""
        return {
            limb: [c for c in self._of((limb,), cross=False) if limb.end in self._reads(c)]
            for limb in self.limbs
        }

    @cached_property
    def limb_cross(self) -> dict[LimbChain, list[Check]]:
        """By limb: checks of its unknown joints against limbs that are known."""
        return {limb: self._of((limb,), cross=True) for limb in self.limbs}

    @cached_property
    def several(self) -> list[Check]:
        """Checks that read unknown joints of more than one limb."""
        return [check for check in self.relevant_checks if len(self._limbs_read(check)) > 1]

    def limbs_of(self, check: Check) -> tuple[int, ...]:
        """Return the open limbs, as indices into `limbs`, whose unknown joints a check reads."""
        read = self._limbs_read(check)
        return tuple(k for k, limb in enumerate(self.limbs) if limb in read)

    def _reads(self, check: Check) -> set[int]:
        return {
            joint for joint in check.points if joint < len(JOINTS) and self.states[joint] != JointState.EXACT
        }

    def _limbs_read(self, check: Check) -> tuple[LimbChain, ...]:
        unknown = self._reads(check)
        return tuple(limb for limb in self.limbs if unknown & set(self.free(limb)))

    def _of(self, limbs: tuple[LimbChain, ...], *, cross: bool) -> list[Check]:
        """Return the checks whose unknown joints are the trunk's and exactly some limbs'."""
        known = {joint for limb in LIMB_CHAINS if limb not in self.limbs for joint in limb.free}
        return [
            check
            for check in self.relevant_checks
            if self._limbs_read(check) == limbs and bool(known & set(check.points)) == cross
        ]
