"""The protocol of checks over time."""

from __future__ import annotations

from typing import ClassVar

from posekit.tree import Findings
from posekit.validators.motion.clip import MotionClip
from posekit.validators.motion.ground import ground_unknown


class MotionCheck:
    """One kind of judgement over a clip: thresholds as fields, a value a frame and place.

    Whoever inherits from it is a frozen dataclass whose fields are its thresholds, each with a default and its unit in
    the docstring; a profile sets them by their names.

    Attributes
    ----------
    name : str
        What profiles and ``--checks`` call it.
    unit : str
        Unit of its values.
    meaning : str
        What it rejects, in one sentence.
    needs : tuple of str
        What must be known of a clip: ``time``, ``up``, ``ground``; it is not asked where that is not known.
    """

    name: ClassVar[str]
    unit: ClassVar[str]
    meaning: ClassVar[str]
    needs: ClassVar[tuple[str, ...]] = ()

    def places(self, clip: MotionClip) -> tuple[str, ...]:
        """Name the K places that it judges in a clip."""
        raise NotImplementedError

    def not_asked(self, clip: MotionClip) -> str:
        """Say why it does not apply to a clip; empty where it does.

        A check with more conditions asks this one first.
        """
        if "time" in self.needs and not clip.step > 0:
            return "the frame rate is not known (--rate)"
        if "up" in self.needs and clip.up is None:
            return "which way is up is not known (--up)"
        if not len(clip):
            return "there is no frame"
        return ground_unknown(clip) if "ground" in self.needs else ""

    def judge(self, clip: MotionClip) -> Findings:
        """Judge a clip.

        Returns
        -------
        Findings
            Value (T, K) in the check's unit, and bounds. NaN is no violation: nothing is said of that frame.
        """
        raise NotImplementedError
