"""Published numbers, typed from their sources again, beside those that posekit uses."""

from __future__ import annotations

import numpy as np
import pytest

from posekit.following.tracking import COMPARED, FALLOFF
from posekit.formats import body_checks
from posekit.ranking import standing
from posekit.recovery.scales import ANNOTATION_SIGMAS
from posekit.skeleton import JOINTS, POINTS
from posekit.validators.motion import ground

COCO = {
    **{"nose": 0.026, "eye": 0.025, "ear": 0.035, "shoulder": 0.079, "elbow": 0.072, "wrist": 0.062},
    **{"hip": 0.107, "knee": 0.087, "ankle": 0.089},
}
"""cocodataset.org/#keypoints-eval."""

DE_LEVA = {
    "upper arm": ((2.55, 2.71), (57.54, 57.72)),
    "forearm": ((1.38, 1.62), (45.59, 45.74)),
    "thigh": ((14.78, 14.16), (36.12, 40.95)),
    "shank": ((4.81, 4.33), (43.52, 43.95)),
}
"""de Leva 1996, table 4, women and men: mass and centre of mass, percent; the shank to the joint of the ankle."""


def test_key_points_spread_as_coco_says() -> None:
    words = [POINTS[k].rpartition("_")[2] for k in COMPARED]
    assert len(words) == 17 and FALLOFF == pytest.approx([2 * COCO[word] for word in words])
    same = {"neck": "shoulder", "pelvis": "hip"}
    words = [same.get(name, name.rpartition("_")[2]) for name in JOINTS]
    assert ANNOTATION_SIGMAS == pytest.approx([COCO[word] for word in words])


def test_shares_of_the_stature_are_those_of_winter() -> None:
    """Winter 2009, figure 4.1: foot 0.152 long, ankle 0.039 high, thigh 0.245, shank 0.246, hand 0.108."""
    shares = [ground.FOOT_SHARE, ground.ANKLE_SHARE, ground.LEG_SHARE, ground.HAND_SHARE]
    assert shares == pytest.approx([0.152, 0.039, 0.491, 0.108])
    assert list(body_checks.LIMB_SHARES.values()) == pytest.approx([0.245, 0.246, 0.186, 0.146])


def test_a_body_weighs_what_its_parts_weigh() -> None:
    limbs = {(start, end, share): centre for start, end, share, centre in standing.LIMB_MASSES}
    assert standing.TRUNK_MASS + 2 * sum(share for *_, share in limbs) == pytest.approx(1, abs=1e-3)
    first = {"upper arm": "shoulder", "forearm": "elbow", "thigh": "hip", "shank": "knee"}
    for name, (mass, centre) in DE_LEVA.items():
        share, place = next(
            (share, place) for (start, _, share), place in limbs.items() if start == first[name]
        )
        assert (share, place) == pytest.approx((np.mean(mass) / 100, np.mean(centre) / 100), abs=2e-4)
