"""The rules of walking, written out joint by joint beside the check."""

from __future__ import annotations

import numpy as np
import pytest

import posekit
from posekit.settings import EXACT, ValidateSettings
from posekit.skeleton import JOINT
from posekit.validators.judge import POSTURE_CHECKS, PostureJudge
from tests.test_checks import postures, walk

FIGURE = posekit.load_figure()
THRESHOLDS = {
    "paper": {"elbow": 0.02, "knee": 0.02, "girdle": 0.01, "out": 10.0, "flexed": 15.0, "lean": 30.0},
    "people": {"elbow": 0.10, "knee": 0.25, "girdle": 0.06, "out": 35.0, "flexed": 40.0, "lean": 35.0},
}
SIDES = ("right", "left")


def unit(vector: np.ndarray) -> np.ndarray:
    return np.asarray(vector / np.linalg.norm(vector))


def angle(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip(unit(a) @ unit(b), -1.0, 1.0))))


def written_out(joints: np.ndarray, walkers: str) -> dict[str, float]:
    """Return the values of all rules of one posture (14, 3); NaN where a swing is near zero."""
    limits = THRESHOLDS[walkers]
    at = {name: joints[k] for name, k in JOINT.items()}
    down = unit(at["pelvis"] - at["neck"])
    facing = [np.cross(down, at[f"left_{part}"] - at[f"right_{part}"]) for part in ("shoulder", "hip")]
    middle = unit(facing[0]) + unit(facing[1])
    forward = unit(middle - (middle @ down) * down)
    left = np.cross(forward, down)

    def swing(name: str) -> float:
        neutral = FIGURE.neutral_points[JOINT[name], 0]
        out = float((at[name] - at["neck"]) @ forward) - neutral
        least = limits.get(name.split("_")[1], limits["girdle"])
        return out / least if abs(out) >= least else np.nan

    def together(one: str, other: str) -> float:
        a, b = swing(one), swing(other)
        return float(np.sign(a * b) * np.minimum(abs(a), abs(b)))

    found = {
        "rule1.arms": -together("right_elbow", "left_elbow"),
        "rule1.legs": -together("right_knee", "left_knee"),
    }
    flexion, lean = [], []
    for side in SIDES:
        found[f"rule2.{side}"] = -together(f"{side}_elbow", f"{side}_knee")
        for limb, start, mid, end in (("arm", "shoulder", "elbow", "wrist"), ("leg", "hip", "knee", "ankle")):
            a, b, c = (at[f"{side}_{name}"] for name in (start, mid, end))
            found[f"rule3.{side}_{limb}"] = together(f"{side}_{start}", f"{side}_{mid}")
            off = max(abs(90 - angle(b - a, left)), abs(90 - angle(c - b, left)))
            found[f"rule4.{side}_{limb}"] = 1 - off / limits["out"]
            if limb == "leg":
                flexion.append(angle(b - a, c - b))
                lean.append(angle(c - a, down))
    found["rule5.knees"] = 1 - min(flexion) / limits["flexed"]
    standing = lean[int(np.argmin(flexion))] if max(flexion) > limits["flexed"] else np.nan
    found["rule5.standing_leg"] = 1 - standing / limits["lean"]
    return found


@pytest.mark.parametrize("walkers", ["paper", "people"])
def test_rules_of_walking_are_those_written_out(walkers: str) -> None:
    joints = np.concatenate([postures(40, seed=3), walk(2.0)[::3]])
    judge = PostureJudge(FIGURE, ValidateSettings(rules=(1, 2, 3, 4, 5), walkers=walkers), EXACT)
    found = judge(POSTURE_CHECKS["walking"], joints)
    expected = [written_out(one, walkers) for one in joints]
    assert set(found.places) == set(expected[0])
    known = 0
    for k, place in enumerate(found.places):
        theirs = np.array([one[place] for one in expected])
        np.testing.assert_allclose(found.value[:, k], theirs, atol=1e-6, err_msg=place)
        known += int(np.isfinite(theirs).sum())
        np.testing.assert_array_equal(found.violated[:, k], theirs < 0)
    assert known > 400


@pytest.mark.parametrize(
    ("rules", "places"), [((1,), 2), ((2,), 2), ((3,), 4), ((4,), 4), ((5,), 2), ((2, 5), 4)]
)
def test_the_named_rules_alone_are_judged(rules: tuple[int, ...], places: int) -> None:
    judge = PostureJudge(FIGURE, ValidateSettings(rules=rules), EXACT)
    found = judge(POSTURE_CHECKS["walking"], postures(3))
    assert len(found.places) == places
    assert {int(place[4]) for place in found.places} == set(rules)
