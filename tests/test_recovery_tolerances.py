"""A result states the noise, the uncertainty of lengths and the tolerances by which its postures were certified."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import posekit
from posekit.cameras import PinholeCamera
from posekit.skeleton import SEGMENT_NAMES
from posekit.synthesis import forget_camera, random_views

FIGURE = posekit.load_figure()
CAMERA = PinholeCamera(K=np.array([[900, 0, 320], [0, 900, 240], [0, 0, 1.0]]), size=(640, 480))
GIRDLE = ("right_shoulder-pelvis", "left_shoulder-pelvis")


def seen(**known: Any) -> posekit.View:
    """Return one noisy posture."""
    truth = random_views(1, np.random.default_rng(11), distance=(4.0, 5.0)).truth
    image = CAMERA.project(truth) + np.random.default_rng(12).normal(0, 2.0, (1, 14, 2))
    return posekit.View(camera=CAMERA, image=image, time=np.zeros(1), root=truth[:, 0], **known)


OWN = {"lengths": dict(FIGURE.lengths)}


@pytest.mark.parametrize(
    ("known", "size", "own", "girdle", "spine"),
    [
        ({**OWN, "deviation": 2.0}, 0.03, 0.04, 0.06, 0.04),
        ({"deviation": 2.5}, 0.07, 0.05, 0.05, 0.05),
        ({"deviation": 2.5, "stature": 1.75}, 0.02, 0.05, 0.05, 0.05),
        # Spines bend by 1.7 % and girdles by 2.7 %, at most by three stated deviations.
        ({**OWN, "length_deviation": 0.02}, 0.02, 0.02, math.hypot(0.02, 0.027), math.hypot(0.02, 0.017)),
        ({**OWN, "length_deviation": 0.004}, 0.004, 0.004, 0.004 * math.sqrt(10), 0.004 * math.sqrt(10)),
    ],
)
def test_certificates_allow_for_what_is_not_known(
    known: dict[str, Any], size: float, own: float, girdle: float, spine: float
) -> None:
    settings = posekit.RecoverSettings(contact_margin=0.01)
    found = posekit.recover(seen(**known), settings)
    stated = found.tolerances["noisy"]
    expected = {name: girdle if name in GIRDLE else own for name in SEGMENT_NAMES} | {"neck-pelvis": spine}
    assert stated["deviation"] == pytest.approx(known.get("deviation", 1.0))
    assert stated["size"] == pytest.approx(size) and stated["by_segment"] == pytest.approx(expected)
    # Lengths may be off by three deviations, at least by 3 cm; limits by three of 2 degrees.
    off = max(math.hypot(size, expected[name]) * length for name, length in found.lengths.items())
    certified = stated["certified"]
    assert certified["rigid"] == certified["tangent"] == pytest.approx(max(0.03, 3 * off))
    assert certified["angle"] == pytest.approx(6.0)
    # Bodies may overlap by 3 cm, and by three deviations of a forearm of 24 cm.
    overlap = 0.03 + 3 * max(expected.values()) * 0.24
    assert stated["contact_margin"] == pytest.approx(0.01 - overlap)


def test_bodies_in_photographs_may_overlap_by_six_centimetres() -> None:
    view = forget_camera(random_views(1, np.random.default_rng(4)))
    found = posekit.recover(view, deviation=3.0)
    noisy = found.tolerances["noisy"]
    assert noisy["contact_margin"] == pytest.approx(found.settings["contact_margin"] - 0.06)
    off = max(noisy["by_segment"][name] * length for name, length in found.lengths.items())
    assert noisy["certified"]["rigid"] == pytest.approx(max(0.03, 3 * off))  # the scale is fitted


def test_a_roots_distance_from_its_ray_is_refused_beyond_twenty_centimetres() -> None:
    view = seen(deviation=2.0)
    ray = view.root[0] / np.linalg.norm(view.root[0])
    aside = np.cross(ray, [0.0, 1.0, 0.0])
    aside /= np.linalg.norm(aside)
    found = []
    for away in (0.19, 0.22):
        moved = posekit.View(
            camera=CAMERA, image=view.image, time=np.zeros(1), root=view.root + away * aside, deviation=2.0
        )
        try:
            found.append(posekit.recover(moved).frames.reason[0])
        except posekit.InputError as error:
            found.append(str(error))
    assert "ray" not in found[0] and "ray" in found[1]
