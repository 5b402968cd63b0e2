"""Robots: found by name or path, loaded as Pinocchio and a second reader see them, pairs, limits, quaternions."""

from __future__ import annotations

import itertools
import os
import pickle
import signal
import struct
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.errors import InputError
from posekit.robots import (
    ProbeLimits,
    QuaternionWarning,
    Robot,
    check_configurations,
    load_robot,
    robot_names,
    untrusted,
)
from posekit.robots.declared import declared_bodies
from posekit.robots.find import find, robots_folder
from posekit.robots.pairs import neutral_inside_limits
from posekit.robots.second_reader import compare_readers
from posekit.robots.srdf import check_srdf
from posekit.robots.urdf_joints import MAX_FREEDOM

LIMIT = '<limit lower="-1" upper="2" effort="10" velocity="10"/>'


def joint(name: str, parent: str, child: str, kind: str = "revolute", inside: str = LIMIT) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0 0 1" rpy="0.1 0.2 0.3"/><axis xyz="0 1 0"/>{inside}</joint>'
    )


def link(name: str, shape: str = '<sphere radius="0.1"/>') -> str:
    body = f"<collision><geometry>{shape}</geometry></collision>" if shape else ""
    return f'<link name="{name}">{body}</link>'


def robot_text(*parts: str, attributes: str = "") -> str:
    return f'<robot name="r"{attributes}>{"".join(parts)}</robot>'


ARM = robot_text(
    link("a"),
    link("b", ""),
    link("c"),
    link("d"),
    joint("ab", "a", "b"),
    joint("bc", "b", "c", "prismatic"),
    joint("cd", "c", "d", "continuous", ""),
)


def refusal_of(call, *arguments, **options) -> str:
    with pytest.raises(InputError) as caught:
        call(*arguments, **options)
    text = str(caught.value)
    assert text.isprintable()
    assert "got " in text
    return text


class TestFind:
    @pytest.mark.parametrize(
        ("name", "file", "srdf"),
        [
            ("human", "human.urdf", None),
            ("simple_humanoid", "simple_humanoid.urdf", "simple_humanoid.srdf"),
            ("g1", "g1_29dof_rev_1_0.urdf", None),
            ("talos", "talos_reduced.urdf", "talos.srdf"),
            ("ur5", "ur5_robot.urdf", "ur5.srdf"),
            ("panda", "panda.urdf", "panda.srdf"),
            ("allegro", "allegro_right_hand.urdf", None),
            ("stick_figure", "stick_figure.urdf", "stick_figure.srdf"),
        ],
    )
    def test_by_name(self, name: str, file: str, srdf: str | None) -> None:
        found = find(name)
        assert found.urdf.name == file
        assert (found.srdf.name if found.srdf else None) == srdf
        assert found.built_in
        assert name in robot_names()

    def test_every_published_urdf_has_a_name_and_exists(self) -> None:
        folder = robots_folder()
        assert folder is not None
        found = {find(name).urdf for name in robot_names()}
        missing = {
            path.relative_to(folder).as_posix() for path in folder.rglob("*.urdf") if path not in found
        }
        # The first is empty; `iris` is the loaders' name for the second's simpler variant.
        assert missing == {"ur_description/urdf/ur3.urdf", "iris_description/robots/iris.urdf"}
        assert all(path.is_file() for path in found)
        assert all(files.srdf is None or files.srdf.is_file() for files in map(find, robot_names()))

    @pytest.mark.parametrize(
        ("name", "said"),
        [("humn", "did you mean human"), ("talso", "talos"), ("zzz", "some names are stick_figure, human")],
    )
    def test_an_unknown_name_lists_the_nearest(self, name: str, said: str) -> None:
        assert said in refusal_of(find, name)

    def test_by_path(self, tmp_path: Path) -> None:
        folder = tmp_path / "mine" / "urdf"
        folder.mkdir(parents=True)
        (tmp_path / "mine" / "package.xml").touch()
        path = folder / "x.urdf"
        path.write_text(ARM)
        found = find(path)
        assert found.package_dirs == (folder, tmp_path / "mine")
        (tmp_path / "mine" / "package.xml").unlink()
        assert find(path).package_dirs == (folder,)
        (tmp_path / "mine" / "meshes").mkdir()
        assert find(path).package_dirs == (folder, tmp_path / "mine")
        assert (found.name, found.srdf, found.built_in) == ("x", None, False)
        (folder / "x.srdf").write_text("<robot/>")
        assert find(str(path)).srdf == folder / "x.srdf"
        assert find(path, package_dirs=(tmp_path,)).package_dirs[0] == tmp_path
        assert "no directory" in refusal_of(find, path, package_dirs=(tmp_path / "none",))
        assert "xacro" in refusal_of(find, tmp_path / "x.urdf.xacro")

    def test_a_file_without_suffix_is_a_path(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        Path("mine").write_text(ARM)
        Path("human").write_text(ARM)
        assert find("mine").urdf == Path("mine")
        assert find("human").built_in
        assert not find("./human").built_in

    def test_a_published_file_by_path_is_built_in(self) -> None:
        by_name = find("human")
        assert find(str(by_name.urdf)).built_in
        assert set(by_name.package_dirs) <= set(find(by_name.urdf).package_dirs)


class TestRobot:
    def test_names(self) -> None:
        robot = Robot(urdf=ARM)
        assert robot.joint_names == ("root_joint", "ab", "bc", "cd")
        assert robot.link_names == ("a", "b", "c", "d")
        assert robot.configuration_names[7:] == ("ab", "bc", "cd.cos", "cd.sin")
        assert robot.lower[7:9].tolist() == [-1, -1]
        assert robot.upper[7:9].tolist() == [2, 2]
        assert robot.model.frames[robot.frame_id("d")].name == "d"
        assert "did you mean" in refusal_of(robot.frame_id, "abc")
        with pytest.raises(ValueError, match="read-only"):
            robot.lower[0] = 0

    def test_a_joint_may_have_a_links_name_or_the_roots(self) -> None:
        text = ARM.replace('"ab"', '"a"').replace('"bc"', '"root_joint"')
        robot = Robot(urdf=text)
        assert robot.joint_names == ("free_flyer", "a", "root_joint", "cd")
        assert robot.model.frames[robot.frame_id("a")].type == pin.FrameType.BODY
        plain = Robot(urdf=ARM)
        q = neutral_inside_limits(plain.model)
        q[7:9] = 0.3, 0.4
        for other in (robot, plain):
            data = other.model.createData()
            pin.framesForwardKinematics(other.model, data, q)
            place = data.oMf[other.frame_id("d")].translation
        np.testing.assert_allclose(place, data.oMf[plain.frame_id("d")].translation)

    def test_default_pairs_are_neither_neighbours_nor_touching(self) -> None:
        # a and c are neighbours: the link between them has no body. a and d touch only when d is large.
        assert Robot(urdf=ARM).collision_pairs == (("a_0", "d_0"),)
        large = ARM.replace(
            '<link name="d"><collision><geometry><sphere radius="0.1"/>',
            '<link name="d"><collision><geometry><sphere radius="9"/>',
        )
        assert Robot(urdf=large).collision_pairs == ()
        assert Robot(urdf=ARM).pairs_from == "neutral posture"

    def test_an_srdf_decides_the_pairs(self) -> None:
        one = '<robot name="r"><disable_collisions link1="d" link2="a"/></robot>'
        assert Robot(urdf=ARM, srdf=one).collision_pairs == (("a_0", "c_0"), ("c_0", "d_0"))
        alone = (
            '<robot><disable_default_collisions link="a"/><enable_collisions link1="a" link2="d"/></robot>'
        )
        assert Robot(urdf=ARM, srdf=alone).collision_pairs == (("a_0", "d_0"), ("c_0", "d_0"))
        nothing = '<robot name="r"><group name="g"/></robot>'
        assert Robot(urdf=ARM, srdf=nothing).pairs_from == "neutral posture"

    def test_neutral_is_moved_into_the_limits(self) -> None:
        robot = Robot(urdf=ARM.replace('lower="-1"', 'lower="0.5"'), free_flyer=False)
        assert neutral_inside_limits(robot.model).tolist() == [0.5, 0.5, 1, 0]

    @pytest.mark.parametrize("name", ["stick_figure", "ur5"])
    def test_a_pickle_is_the_same_robot(self, name: str) -> None:
        robot = load_robot(name)
        again = pickle.loads(pickle.dumps(robot))
        assert again.hash == robot.hash
        assert again.collision_pairs == robot.collision_pairs
        assert list(again.model.names) == list(robot.model.names)

    def test_the_hash_tells_texts_apart(self) -> None:
        texts = [(ARM, None), (ARM, "<robot/>"), (ARM + " ", None)]
        assert len({Robot(urdf=urdf, srdf=srdf).hash for urdf, srdf in texts}) == 3

    @pytest.mark.parametrize(
        ("spelling", "version"),
        [
            ('<capsule radius="0.1" length="0.2"/>', ' version="1.1"'),
            ('<capsule radius="0.1" length="0.2"/>', ' version="1.2"'),
        ],
    )
    def test_capsules_are_loaded_as_such(self, spelling: str, version: str) -> None:
        robot = Robot(urdf=robot_text(link("a", spelling), attributes=version))
        assert robot.geometry is not None
        body = robot.geometry.geometryObjects[0].geometry
        assert type(body).__name__ == "Capsule"
        assert (body.radius, 2 * body.halfLength) == (0.1, 0.2)

    def test_a_body_that_is_loaded_as_another_shape_is_refused(self, monkeypatch: pytest.MonkeyPatch) -> None:
        robot = Robot(urdf=ARM, with_geometry=False)
        from posekit.robots import geometry

        tree = robot.tree
        box = tree.find("link[@name='d']/collision/geometry/sphere")
        assert box is not None
        declared = list(declared_bodies(tree))
        monkeypatch.setattr(geometry, "declared_bodies", lambda _robot: declared)
        collision = tree.find("link[@name='d']/collision")
        assert collision is not None
        collision.remove(collision[0])
        text = refusal_of(geometry.build_geometry, robot.model, tree, "x")
        assert "link 'd': got 0 of 1 sphere bodies loaded" in text


class TestSecondReader:
    def test_mimics_continuous_and_slides_are_compared(self) -> None:
        text = ARM.replace(
            "</joint></robot>", '<mimic joint="ab" multiplier="-2" offset="0.1"/></joint></robot>'
        )
        assert compare_readers(text, Robot(urdf=text).model, "x")

    def test_another_model_is_noticed(self) -> None:
        other = Robot(urdf=ARM.replace('<origin xyz="0 0 1"', '<origin xyz="0 0 1.001"', 1)).model
        assert "two readers place link 'b'" in refusal_of(compare_readers, ARM, other, "x")
        fewer = Robot(urdf=ARM.replace('"bc" type="prismatic"', '"bc" type="fixed"')).model
        assert "joint 'bc' is read by one reader" in refusal_of(compare_readers, ARM, fewer, "x")

    def test_a_turned_and_shifted_chain_as_long_as_may_be_costs_little(self) -> None:
        """yourdfpy's own graph took n^4: 68 s for 240 links."""
        names = [f"l{k}" for k in range(MAX_FREEDOM + 1)]
        text = robot_text(
            *(link(name, "") for name in names),
            *(joint(f"j{b}", a, b) for a, b in itertools.pairwise(names)),
        )
        model, start = Robot(urdf=text).model, time.process_time()
        assert compare_readers(text, model, "x")
        assert time.process_time() - start < 10
        other = Robot(urdf=text.replace('rpy="0.1 0.2 0.3"', 'rpy="0.1 0.2 0.30001"', 1)).model
        assert "two readers place link 'l1'" in refusal_of(compare_readers, text, other, "x")

    def test_a_robot_of_as_many_joints_as_may_be_is_loaded_and_one_more_is_refused(
        self, tmp_path: Path
    ) -> None:
        """What Pinocchio keeps grows as their cube: of 250 it took more than a child may have, which did not say so."""
        for more in (0, 1):
            names = [f"l{k}" for k in range(MAX_FREEDOM + 1 + more)]
            path = tmp_path / f"{more}.urdf"
            moving = (joint(f"j{b}", a, b) for a, b in itertools.pairwise(names))
            path.write_text(robot_text(*(link(name, "") for name in names), *moving))
            if not more:
                assert load_robot(path).model.nv == MAX_FREEDOM + 6
        said = refusal_of(load_robot, path)
        assert f"joints with {MAX_FREEDOM + 1} degrees of freedom; expected at most {MAX_FREEDOM}" in said

    def test_what_it_cannot_read_is_passed_over_where_that_is_said(self) -> None:
        text = robot_text(link("a", '<capsule radius="1" length="1"/>'), attributes=' version="1.1"')
        model = Robot(urdf=text).model
        assert not compare_readers(text, model, "x", must_read=False)
        assert "a second reader cannot read it" in refusal_of(compare_readers, text, model, "x")


class TestMeshPaths:
    @pytest.fixture
    def model(self, tmp_path: Path) -> Path:
        """Return a folder of a model, beside a mesh that is not its own."""
        (tmp_path / "model" / "meshes").mkdir(parents=True)
        triangle = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0)
        for folder in (tmp_path, tmp_path / "model" / "meshes"):
            (folder / "m.stl").write_bytes(b" " * 80 + struct.pack("<I", 1) + triangle)
        (tmp_path / "model" / "in.stl").symlink_to("meshes/m.stl")
        (tmp_path / "model" / "out.stl").symlink_to("../m.stl")
        (tmp_path / "model" / "away").symlink_to("..")
        (tmp_path / "model" / "UPPER.STL").symlink_to("meshes/m.stl")
        return tmp_path / "model"

    def load(self, model: Path, name: str) -> Robot:
        text = robot_text(link("a", f'<mesh filename="{name}" scale="1 -1 2"/>'))
        (model / "x.urdf").write_text(text)
        return load_robot(model / "x.urdf", untrusted=False)

    @pytest.mark.parametrize(
        "name",
        [
            "meshes/m.stl",
            "./meshes/../meshes/m.stl",
            "package://model/meshes/m.stl",
            "package:///model/meshes/m.stl",
            "package://meshes/m.stl",
            "file://{model}/meshes/m.stl",
            "{model}/meshes/m.stl",
            "in.stl",
            "UPPER.STL",
        ],
    )
    def test_inside(self, model: Path, name: str) -> None:
        robot = self.load(model, name.format(model=model))
        assert robot.body_links == ("a",)
        assert len(pickle.loads(pickle.dumps(robot)).body_names) == 1

    @pytest.mark.parametrize(
        "name",
        [
            "../m.stl",
            "package://model/../m.stl",
            "package://../m.stl",
            "file://{model}/../m.stl",
            "{model}/../m.stl",
            "out.stl",
            "away/m.stl",
            "package://model/out.stl",
        ],
    )
    def test_outside(self, model: Path, name: str) -> None:
        assert (model / "../m.stl").is_file()
        text = refusal_of(self.load, model, name.format(model=model))
        assert "outside of them; expected a mesh inside the model's package directories" in text

    @pytest.mark.parametrize(
        ("name", "said"),
        [
            ("none.stl", "no such file there"),
            ("package://other/m.stl", "no such file there"),
            ("package://meshes", 'the suffix ""'),
            ("http://example.org/m.stl", "package://, file:// or a path"),
            ("model://model/m.stl", "package://, file:// or a path"),
            ("meshes", 'the suffix ""'),
            ("x.urdf", 'the suffix ".urdf"'),
            ("a" * 300, "too long"),
        ],
    )
    def test_no_mesh(self, model: Path, name: str, said: str) -> None:
        assert said in refusal_of(self.load, model, name)

    def test_pipes_are_no_meshes(self, model: Path) -> None:
        os.mkfifo(model / "p.stl")
        assert "a pipe or a device" in refusal_of(self.load, model, "p.stl")

    def test_meshes_are_not_looked_for_when_geometry_is_not_wanted(self, model: Path) -> None:
        (model / "x.urdf").write_text(robot_text(link("a", '<mesh filename="none.stl"/>')))
        assert load_robot(model / "x.urdf", untrusted=False, geometry=False).geometry is None

    def test_another_directory_can_be_named(self, model: Path) -> None:
        (model / "x.urdf").write_text(robot_text(link("a", '<mesh filename="package://meshes/m.stl"/>')))
        elsewhere = model.parent / "elsewhere"
        elsewhere.mkdir()
        (model / "x.urdf").rename(elsewhere / "x.urdf")
        with pytest.raises(InputError, match="no such file"):
            load_robot(elsewhere / "x.urdf", untrusted=False)
        assert load_robot(elsewhere / "x.urdf", untrusted=False, package_dirs=(model,)).body_links == ("a",)


class TestChildProcess:
    @pytest.fixture
    def path(self, tmp_path: Path) -> Path:
        (tmp_path / "x.urdf").write_text(ARM)
        return tmp_path / "x.urdf"

    def test_a_stranger_is_loaded_there_first(self, path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        robot = load_robot(path)
        assert robot.collision_pairs == (("a_0", "d_0"),)
        asked = []
        monkeypatch.setattr("posekit.robots.loading.probe", lambda *_arguments, **_options: asked.append(1))
        load_robot(path)
        load_robot("human", untrusted=True)
        assert len(asked) == 2
        load_robot(path, untrusted=False)
        load_robot("human")
        assert len(asked) == 2

    def test_what_the_child_refuses_is_said_here(self, path: Path) -> None:
        settings = {"urdf": "<robot/>", "source": "x.urdf", "package_dirs": ()}
        with pytest.raises(InputError, match=r"^x\.urdf: got 0 links"):
            untrusted.probe(settings, compare=False)

    @pytest.mark.parametrize(
        ("code", "said"),
        [
            (f"import os; os.kill(os.getpid(), {int(signal.SIGSEGV)})", "ended with SIGSEGV"),
            ("import os; os.abort()", r"ended with SIGABRT \(as when memory runs out\)"),
            (f"import os; os.kill(os.getpid(), {int(signal.SIGXCPU)})", "more than 60 s of processor time"),
            ("import sys; sys.exit(3)", "ended with exit status 3"),
            ("raise ValueError", "ended with exit status 1"),
            ("print('{')", "ended with exit status 0"),
        ],
    )
    def test_a_crash_is_one_line(
        self, path: Path, monkeypatch: pytest.MonkeyPatch, code: str, said: str
    ) -> None:
        monkeypatch.setattr(untrusted, "_CODE", code)
        with pytest.raises(InputError, match=said) as caught:
            load_robot(path)
        assert str(caught.value).startswith(f"{path}: got a process that")

    def test_a_hang_ends(self, path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(untrusted, "_CODE", "import time; time.sleep(60)")
        with pytest.raises(InputError, match=r"a process that took more than 0\.5 s"):
            load_robot(path, limits=ProbeLimits(wall=0.5))

    def test_the_child_has_the_limits(self, path: Path) -> None:
        with pytest.raises(InputError, match=r"ended with|needs more than 0\.1 GB of memory"):
            load_robot(path, limits=ProbeLimits(memory=100_000_000))

    def test_processor_time_is_bounded(self, path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        burn = "from posekit.robots.probe import _set_limits; _set_limits(2**32, 1)\nwhile True: pass"
        monkeypatch.setattr(untrusted, "_CODE", burn)
        with pytest.raises(InputError, match="more than 1 s of processor time"):
            load_robot(path, limits=ProbeLimits(cpu=1, wall=30))

    def test_nothing_is_imported_from_the_working_directory(
        self, path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.chdir(path.parent)
        for name in ("numpy", "pinocchio", "posekit", "json", "yourdfpy"):
            Path(f"{name}.py").write_text("open('imported', 'w')")
        assert load_robot(path).name == "x"
        assert not Path("imported").exists()

    def test_nothing_can_be_written_there(self, tmp_path: Path) -> None:
        code = (
            "from posekit.robots.probe import _set_limits; _set_limits(2**33, 60)\n"
            f"open({str(tmp_path / 'w')!r}, 'wb', buffering=0).write(b'x' * 10)"
        )
        done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, timeout=60)
        assert b"File too large" in done.stderr
        assert not (tmp_path / "w").read_bytes()


def quaternion_rows(rng: np.random.Generator, n: int) -> np.ndarray:
    q = rng.normal(size=(n, 4))
    return np.asarray(q / np.linalg.norm(q, axis=1, keepdims=True))


class TestConfigurations:
    MODEL = Robot(urdf=ARM).model

    def rows(self, rng: np.random.Generator, n: int = 5) -> np.ndarray:
        q = np.zeros((n, self.MODEL.nq))
        q[:, 3:7] = quaternion_rows(rng, n)
        q[:, 9:11] = [0.6, 0.8]
        return q

    def test_good_ones_stay_bit_for_bit(self, rng: np.random.Generator) -> None:
        q = self.rows(rng)
        q[:, 3:7] *= 1 + 9e-7
        np.testing.assert_array_equal(check_configurations(self.MODEL, q), q)
        assert check_configurations(self.MODEL, np.zeros((0, self.MODEL.nq))).shape == (0, self.MODEL.nq)

    @given(scale=st.floats(0.9901, 1.0099), place=st.sampled_from([slice(3, 7), slice(9, 11)]))
    def test_rounded_ones_are_normalised_with_a_warning(self, scale: float, place: slice) -> None:
        if abs(scale - 1) < 2e-6:
            return
        q = self.rows(np.random.default_rng(1))
        q[2, place] *= scale
        before = q.copy()
        with pytest.warns(QuaternionWarning, match="file.json: quaternions were up to"):
            checked = check_configurations(self.MODEL, q, "file.json")
        np.testing.assert_allclose(np.linalg.norm(checked[:, place], axis=1), 1, rtol=1e-12)
        np.testing.assert_array_equal(q, before)
        np.testing.assert_array_equal(np.delete(checked, 2, axis=0), np.delete(before, 2, axis=0))

    @pytest.mark.parametrize(
        ("change", "said"),
        [
            ((2, 4, np.nan), r"\[2, 4\]: got nan; expected finite"),
            ((1, 7, np.inf), r"\[1, 7\]: got inf"),
            ((0, 3, 3.0), "the quaternion of 'root_joint' of length"),
            ((4, 9, 0.0), r"cosine and sine of 'cd' of length 0\.8 in row 4"),
        ],
    )
    def test_others_are_refused(self, rng: np.random.Generator, change: tuple, said: str) -> None:
        q = self.rows(rng)
        row, column, value = change
        q[row, column] = value
        with pytest.raises(InputError, match=said):
            check_configurations(self.MODEL, q)

    def test_a_quaternion_of_zeros_is_refused(self, rng: np.random.Generator) -> None:
        q = self.rows(rng)
        q[1, 3:7] = 0
        with pytest.raises(InputError, match="of length 0 in row 1"):
            check_configurations(self.MODEL, q)

    @pytest.mark.parametrize("shape", [(11,), (2, 10), (2, 12), (1, 2, 11), ()])
    def test_other_shapes_are_refused(self, shape: tuple[int, ...]) -> None:
        assert "expected shape (N, 11)" in refusal_of(check_configurations, self.MODEL, np.zeros(shape))

    def test_what_is_no_array_is_refused(self) -> None:
        assert "no array of numbers" in refusal_of(check_configurations, self.MODEL, [[1], [2, 3]])
        assert "no array of numbers" in refusal_of(check_configurations, self.MODEL, "q")

    def test_planar_and_floating_joints_have_rotations_too(self) -> None:
        text = ARM.replace('"continuous"', '"planar"').replace('"prismatic"', '"floating"')
        robot = Robot(urdf=text)
        assert robot.configuration_names[7:] == (
            *("ab", "bc.x", "bc.y", "bc.z", "bc.qx", "bc.qy", "bc.qz", "bc.qw"),
            *("cd.x", "cd.y", "cd.cos", "cd.sin"),
        )
        q = pin.neutral(robot.model)[None]
        np.testing.assert_array_equal(check_configurations(robot.model, q), q)
        for name in ("bc.qw", "cd.cos"):
            wrong = q.copy()
            wrong[0, robot.configuration_names.index(name)] = 0.5
            assert "of length 0.5" in refusal_of(check_configurations, robot.model, wrong)


class TestSrdf:
    def test_what_is_refused(self) -> None:
        for text, said in [
            ("<x/>", "the root element is <x>"),
            ("", "not well-formed"),
            ('<robot><disable_collisions link1="a" link2="z"/></robot>', 'the link "z"; expected a link'),
            ('<robot><disable_collisions link1="a"/></robot>', 'the link ""'),
            ('<robot><disable_default_collisions link="q"/></robot>', 'the link "q"'),
            ('<!DOCTYPE a [<!ENTITY b "c">]><robot/>', "DOCTYPE"),
        ]:
            assert said in refusal_of(check_srdf, text, "x.srdf", ["a", "b"])

    def test_a_pair_has_no_order(self) -> None:
        srdf = check_srdf('<robot><disable_collisions link1="a" link2="b"/></robot>', "x", ["a", "b", "c"])
        assert not srdf.checks("a", "b")
        assert not srdf.checks("b", "a")
        assert srdf.checks("a", "c")
