"""Robots that others publish are loaded as Pinocchio reads them, with the pairs that their SRDF leaves."""

from __future__ import annotations

import re

import numpy as np
import pinocchio as pin
import pytest

from posekit.body import load_figure
from posekit.errors import InputError
from posekit.robots import load_robot
from posekit.robots.find import find
from posekit.robots.pairs import neutral_inside_limits
from posekit.robots.second_reader import compare_readers


class TestPublishedRobots:
    @pytest.mark.parametrize("name", ["human", "simple_humanoid", "talos", "ur5", "panda", "allegro", "pr2"])
    def test_are_what_pinocchio_reads_from_the_file(self, name: str) -> None:
        robot, files = load_robot(name), find(name)
        assert files.urdf.parents[2].name == "robots" or name == "stick_figure"
        folder = str(files.package_dirs[0].parent)
        model = pin.buildModelFromUrdf(str(files.urdf), pin.JointModelFreeFlyer())
        geometry = pin.buildGeomFromUrdf(
            model, str(files.urdf), pin.GeometryType.COLLISION, package_dirs=[folder]
        )
        assert list(robot.model.names) == list(model.names)
        np.testing.assert_array_equal(robot.lower, model.lowerPositionLimit)
        np.testing.assert_array_equal(robot.upper, model.upperPositionLimit)
        assert robot.body_names == tuple(body.name for body in geometry.geometryObjects)
        assert len(robot.configuration_names) == len(set(robot.configuration_names)) == model.nq
        assert compare_readers(robot.urdf, robot.model, name)
        q = neutral_inside_limits(model)
        for mine, theirs in zip(robot.model.frames, model.frames, strict=True):
            assert mine.name == theirs.name
        data, other = robot.model.createData(), model.createData()
        pin.framesForwardKinematics(robot.model, data, q)
        pin.framesForwardKinematics(model, other, q)
        for mine, theirs in zip(data.oMf, other.oMf, strict=True):
            np.testing.assert_array_equal(mine.homogeneous, theirs.homogeneous)

    @pytest.mark.parametrize("name", ["stick_figure", "talos", "ur5", "panda", "solo8", "pr2", "anymal_c"])
    def test_pairs_of_an_srdf_are_those_that_pinocchio_leaves(self, name: str) -> None:
        robot = load_robot(name)
        assert robot.geometry is not None
        assert robot.pairs_from == "srdf"
        geometry = robot.geometry.copy()
        geometry.removeAllCollisionPairs()
        geometry.addAllCollisionPairs()
        pin.removeCollisionPairsFromXML(robot.model, geometry, robot.srdf)
        names = robot.body_names
        theirs = {(names[pair.first], names[pair.second]) for pair in geometry.collisionPairs}
        assert set(robot.collision_pairs) == theirs
        assert theirs

    def test_the_human_has_no_bodies_but_masses(self) -> None:
        robot = load_robot("human")
        assert (robot.body_names, robot.collision_pairs) == ((), ())
        assert sum(inertia.mass for inertia in robot.model.inertias) > 0
        assert robot.model.nq == 7 + 36
        assert robot.configuration_names[:7] == ("x", "y", "z", "qx", "qy", "qz", "qw")
        assert "right_knee_Z" in robot.joint_names

    def test_the_stick_figure_is_the_figure(self) -> None:
        robot, figure = load_robot("stick_figure"), load_figure()
        assert robot.hash == figure.hash
        assert robot.configuration_names == figure.configuration_names
        assert all(inertia.mass > 0 for inertia in robot.model.inertias[2:])
        names = [figure.capsules[k].link for k in range(len(figure.capsules))]
        pairs = {tuple(sorted((names[a], names[b]))) for a, b in figure.collision_pairs}
        links = dict(zip(robot.body_names, robot.body_links, strict=True))
        assert {tuple(sorted((links[a], links[b]))) for a, b in robot.collision_pairs} == pairs

    def test_a_shared_srdf_names_links_that_a_variant_has_not(self) -> None:
        robot = load_robot("solo8")
        assert robot.unknown_links
        files = find("solo8")
        with pytest.raises(
            InputError, match=f"got .*{re.escape(repr(robot.unknown_links[0])[1:-1])}"
        ) as caught:
            load_robot("solo8", srdf=files.srdf)
        assert str(caught.value).isprintable()

    def test_a_fixed_base_and_no_geometry(self) -> None:
        robot = load_robot("ur5", free_flyer=False, geometry=False)
        assert robot.model.nq == 6
        assert robot.geometry is None
        assert not robot.body_names + robot.body_links
        assert not robot.collision_pairs
        assert robot.configuration_names == robot.joint_names

    def test_visual_bodies_are_loaded_when_they_are_wanted(self) -> None:
        robot = load_robot("ur5", visuals=True)
        assert robot.visuals is not None
        assert len(robot.visuals.geometryObjects) > 0
        assert load_robot("ur5").visuals is None

    def test_a_broken_one_says_what_is_broken(self) -> None:
        with pytest.raises(InputError, match='got a mimic of "index_q1"; expected a joint') as caught:
            load_robot("alex_psyonic_hands")
        assert str(caught.value).isprintable()
