"""Objects by name, by the path of a URDF, or by a linkage file that names its robot."""

import numpy as np
import pytest

from posekit.errors import InputError
from posekit.linkages import load_linkage
from posekit.objects import (
    load_object,
)
from posekit.robots import load_robot


class TestLoading:
    def test_names_of_nothing(self):
        with pytest.raises(InputError, match="did you mean panda"):
            load_object("pandaa")
        with pytest.raises(InputError, match="taylor_human"):
            load_object("nothing like it")

    def test_a_urdf_by_path(self, tmp_path):
        robot = load_robot("ur5", geometry=False)
        path = tmp_path / "arm.urdf"
        path.write_text(robot.urdf, encoding="utf-8")
        thing = load_object(path)
        assert thing.linkage.points == load_object("ur5").linkage.points

    def test_a_linkage_file_with_a_robot(self, tmp_path):
        path = tmp_path / "forearm.toml"
        lines = [
            'schema = "posekit.linkage/1"', 'urdf = "panda"', "unit = 1",
            'points = ["panda_joint3", "panda_joint4", "panda_joint5"]', "[segments]",
            "panda_joint3-panda_joint4 = 0.0825", "panda_joint4-panda_joint5 = 0.4",
        ]  # fmt: skip
        path.write_text("\n".join(lines), encoding="utf-8")
        with pytest.raises(InputError, match=r"0\.4 m long, and 0\.3927\d+ m in its robot panda"):
            load_object(path)
        good = "\n".join(lines).replace("0.4", "0.393")
        path.write_text(good, encoding="utf-8")
        thing = load_object(path)
        assert thing.robot is not None
        np.testing.assert_allclose(thing.linkage.lengths[1], np.hypot(0.0825, 0.384), rtol=1e-12)
        path.write_text(good.replace("unit = 1", ""), encoding="utf-8")
        with pytest.raises(InputError, match="its lengths are relative"):
            load_object(path)
        path.write_text(good.replace("panda_joint5", "panda_elbow"), encoding="utf-8")
        with pytest.raises(InputError, match=r"panda_elbow.* is no link or joint"):
            load_object(path)
        path.write_text(good.replace("panda_joint5", "panda_joint7"), encoding="utf-8")
        with pytest.raises(
            InputError, match="is no rigid segment of its robot panda: panda_joint5, panda_joint6"
        ):
            load_object(path)

    def test_built_in_linkages_load(self):
        thing = load_object("taylor_human")
        assert thing.robot is None and thing.linkage.points == load_linkage("taylor_human").points
