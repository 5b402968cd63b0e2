"""Write a check of your own: nobody's feet are below the ground. The tree is pruned with it, and postures are judged.

python examples/own_check.py
"""

from dataclasses import dataclass, replace

import numpy as np

import posekit
from posekit.geometry import Array
from posekit.skeleton import JOINT
from posekit.validators import Check, Findings, Loosening, Place, Scope


@dataclass(frozen=True, kw_only=True)
class FeetAboveGround(Check):
    """Both ankles are at least as high as the ground.

    Parameters
    ----------
    ground : float
        Height of the ground over the origin of the postures' frame, metres: 0 in a world on the ground, and minus the
        camera's height in that of a camera.
    up : tuple of float
        Which way is up in that frame; whoever asks the check says it (`oriented`).
    """

    ground: float = 0.0
    up: tuple[float, ...] = (0.0, 0.0, 1.0)

    name = "feet_above_ground"
    unit = "m"
    places = (Place(joint="right_ankle"), Place(joint="left_ankle"))
    points = (JOINT["right_ankle"], JOINT["left_ankle"])
    scope = Scope.VIEW
    noise = Loosening.REFINED

    def oriented(self, up: Array) -> Check:
        """Take the direction against gravity (3,) for up."""
        return replace(self, up=tuple(up.tolist()))

    def judge(self, points: Array) -> Findings:
        """Measure the heights (N, 2) of both ankles (N, 2, 3); an ankle that is not known is NaN, and undecided."""
        height = points @ np.array(self.up) - self.ground
        return Findings(value=height, lower=np.zeros(2), upper=np.full(2, np.inf), tolerance=0.01)


def main() -> None:
    """Recover a view with the check and without it, and validate what came out."""
    view = posekit.builtin_view("seq1")
    physical = ["rigid-parts", "joint-range", "collision"]
    feet = FeetAboveGround(ground=-0.78)
    before, after = (posekit.recover(view, checks=checks) for checks in (physical, [*physical, feet]))
    for k, (one, other) in enumerate(zip(before.frames, after.frames, strict=True)):
        lost = sum(count for reason, count in other.rejected.items() if reason.startswith(feet.name))
        print(
            f"frame {k}: {len(one)} postures, {len(other)} with feet above the ground; {lost} leaves were rejected"
        )

    # In the frame of a camera up is against y: a validator must be told, a recovery knows.
    validator = posekit.Validator(checks=[feet], up=(0.0, -1.0, 0.0))
    print(
        "valid with feet above the ground:",
        [int(validator.check(f.joints).valid.sum()) for f in before.frames],
    )


if __name__ == "__main__":
    main()
