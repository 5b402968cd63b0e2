"""A posture of a robot is certified by a configuration within its limits, or it is said what stands against it."""

import numpy as np
import pinocchio as pin
import pytest

from benchmarks.studies.object_study import study_lines, study_object
from posekit.errors import InputError
from posekit.objects import (
    certify,
    load_object,
)
from posekit.objects.certify import Certifier
from posekit.objects.drawn_views import draw_configurations
from posekit.robots import Robot


def robot_of(thing):
    """Return the robot of an object that has one."""
    assert thing.robot is not None
    return thing.robot


@pytest.mark.parametrize(
    ("limits", "window"),
    [
        ((10, 20), (10, 10 + 2 * np.pi)),
        ((-20, -10), (-10 - 2 * np.pi, -10)),
        ((-20, 20), (-np.pi, np.pi)),
        ((-1, 20), (-1, 2 * np.pi - 1)),
        ((1, 1.5), (1, 1.5)),
    ],
)
def test_a_joint_is_drawn_within_its_limits_over_the_turn_nearest_to_zero(limits, window):
    text = (
        '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="revolute"><parent link="a"/>'
        '<child link="b"/><axis xyz="0 0 1"/><limit lower="{}" upper="{}" effort="1" velocity="1"/></joint></robot>'
    )
    robot = Robot(urdf=text.format(*limits), free_flyer=False)
    (drawn,) = draw_configurations(robot, 2000, np.random.default_rng(0)).T
    np.testing.assert_allclose((drawn.min(), drawn.max()), window, atol=0.02)
    assert drawn.min() >= limits[0] and drawn.max() <= limits[1]


class TestCertifier:
    @pytest.mark.parametrize("name", ["panda", "ur5", "allegro"])
    def test_the_truth_has_a_configuration(self, robots, name):
        thing, _ = robots(name)
        robot = robot_of(thing)
        certifier = Certifier(robot, thing.linkage.points)
        q = draw_configurations(robot, 40, np.random.default_rng(10))
        points = certifier.kinematics.positions(q) + np.array([0.3, -0.2, 4.0])
        found = certifier.certify(points, tolerance=1e-6)
        assert all(found.certified) and not any(found.reasons)
        np.testing.assert_allclose(certifier.kinematics.positions(found.q), points, atol=1e-6)
        assert (found.q[:, 7:] >= robot.lower[7:]).all() and (found.q[:, 7:] <= robot.upper[7:]).all()

    def test_what_cannot_be_reached_is_undecided_with_the_reason(self, robots):
        thing, truth = robots("panda")
        certifier = Certifier(robot_of(thing), thing.linkage.points)
        stretched = truth[:1] * 1.2
        found = certifier.certify(stretched, tolerance=1e-6)
        assert found.certified == [False]
        assert found.reasons[0].startswith(
            "undecided: no configuration was found, with limits or without; panda_"
        )
        q = pin.neutral(robot_of(thing).model)[None].copy()
        q[0, 10] = 0.4  # panda_joint4, whose limits are -3.07 and -0.07
        q[0, 12] = 1.0
        found = certifier.certify(certifier.kinematics.positions(q), tolerance=1e-6)
        assert found.certified == [False]
        assert (
            "no configuration within the limits was found; without them panda_joint4 is" in found.reasons[0]
        )

    def test_only_so_many_are_looked_for(self, robots, monkeypatch):
        thing, truth = robots("panda")
        monkeypatch.setattr(certify, "MAX_POSTURES_CERTIFIED", 2)
        found = Certifier(robot_of(thing), thing.linkage.points).certify(truth, tolerance=1e-6)
        assert found.certified == [True, True, False] and np.isnan(found.q[2]).all()
        assert "first 2 postures alone" in found.reasons[2]

    def test_the_study_counts(self, robots):
        thing, _ = robots("panda")
        study = study_object(thing, count=4, seed=1)
        assert study.flips == 64 and study.found.all() and study.sure.all()
        assert (study.certified <= study.survivors).all() and (study.survivors <= 16).all()
        assert study_lines("panda", study)[0].startswith("| panda | 64 | ")
        with pytest.raises(InputError, match="has no robot"):
            study_object(load_object("taylor_human"))
