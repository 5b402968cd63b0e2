"""Robots: loading, refusals, names, mimics, columns, kinematics and collisions, against Pinocchio."""

from __future__ import annotations

import pickle
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import posekit
from posekit.errors import InputError
from posekit.robots import Robot, load_robot, robot_names
from posekit.settings import ValidateSettings
from posekit.validators import Validator

LIMIT = '<limit lower="-1" upper="2" effort="10" velocity="10"/>'


def joint(
    name: str,
    parent: str,
    child: str,
    kind: str = "revolute",
    inside: str = LIMIT,
    z: float = 0.4,
    axis: str = "0 1 0",
) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.1 0 {z}" rpy="0.1 0.2 0.3"/><axis xyz="{axis}"/>{inside}</joint>'
    )


def link(name: str, shape: str = '<sphere radius="0.1"/>') -> str:
    body = f"<collision><geometry>{shape}</geometry></collision>" if shape else ""
    return f'<link name="{name}">{body}</link>'


def text(*parts: str) -> str:
    return f'<robot name="r">{"".join(parts)}</robot>'


def mimic(of: str) -> str:
    return f'{LIMIT}<mimic joint="{of}" multiplier="-2" offset="0.1"/>'


ALL_KINDS = text(
    *map(link, "abcdefg"),
    joint("hinge", "a", "b", axis="0.6 0 -0.8"),
    joint("turn_joint", "b", "c", "continuous", "", axis="0 -0.8 0.6"),
    joint("slide", "c", "d", "prismatic", axis="0 0 -1"),
    joint("follower", "b", "e", inside=mimic("hinge")),
    joint("second", "e", "f", inside=mimic("follower")),
    joint("plane", "d", "g", "planar", ""),
)
"""Every type of joint, a mimic, and a mimic of a mimic."""


def configurations(robot: Robot, count: int, reach: float = 1.0, seed: int = 0) -> np.ndarray:
    """Draw configurations inside the limits."""
    rng = np.random.default_rng(seed)
    steps = reach * rng.normal(size=(count, robot.model.nv))
    q = np.array([pin.integrate(robot.model, np.array(robot.neutral), step) for step in steps])
    return np.array(np.clip(q, robot.lower, robot.upper))


@pytest.fixture(scope="module")
def g1() -> Robot:
    return load_robot("g1")


# --- loading and refusals


@pytest.mark.parametrize(
    ("urdf", "words"),
    [
        ("", "XML"),
        ('<!DOCTYPE robot [<!ENTITY a "b">]><robot name="r"><link name="a"/></robot>', "DOCTYPE"),
        ("<sdf/>", "<robot>"),
        (text(), "0 links"),
        (text(link("a"), link("a")), "2 times"),
        (text(link("a"), link("stray")), "one root link"),
        (text(link("a"), link("b"), joint("j", "a", "c")), "a parent and a child"),
        (text(link("a"), link("b"), joint("j", "a", "b"), joint("k", "a", "b")), "already hangs"),
        (text(link("a"), link("b"), joint("j", "a", "b", inside="")), "make it continuous"),
        (text(link("a"), link("b"), joint("j", "a", "b", "hinge")), "prismatic"),
        (text(link("a"), link("b"), joint("j", "a", "b", inside=LIMIT.replace("-1", "3"))), "exchange them"),
        (text(link("a"), link("b"), joint("j", "a", "b", inside=LIMIT.replace('"2"', '"${x}"'))), "xacro"),
        (
            text(link("a"), link("b"), joint("j", "a", "b", inside=LIMIT.replace('"2"', '"nan"'))),
            "a finite number",
        ),
        (text(link("a"), link("b"), joint("j", "a", "b", inside=mimic("k"))), "mimic"),
        (text(link("a"), link("b"), joint("j", "a", "b", inside=mimic("j"))), "mimic of itself"),
        (text(link("a", '<box size="0 0 0"/>')), "positive size"),
        (text(link("a", "<box/>")), "positive size"),
        (text(link("a", "<ball/>")), "one of box"),
        (text(link("a", '<mesh filename="x.stl" scale="1 1 0"/>')), "scale 0"),
        (text(link("")), "a printable name"),
        (text(link("a", '<mesh filename="../x.stl"/>')), "no such file"),
        (text(link("a", '<mesh filename="http://h/x.stl"/>')), "package://"),
        (
            text(
                *(link(f"l{k}") for k in range(300)),
                *(joint(f"j{k}", f"l{k}", f"l{k + 1}", "fixed", "") for k in range(299)),
            ),
            "250",
        ),
        (
            text(*map(link, "abc"), *(joint(n, "a", n, inside=LIMIT.replace('"2"', '"120"')) for n in "bc")),
            "120 degrees are 2.094 rad",
        ),
    ],
)
def test_bad_urdf_is_refused_in_one_line(urdf: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        Robot(urdf=urdf, source="bad.urdf")
    message = str(caught.value)
    assert words in message and message.startswith("bad.urdf: ") and "\n" not in message


def test_broken_texts_raise_nothing_else() -> None:
    """Cut and damaged texts are refused or loaded; nothing else happens."""
    rng = np.random.default_rng(1)
    refused = 0
    for _ in range(150):
        letters = list(ALL_KINDS)
        for at in rng.integers(len(letters), size=3):
            letters[at] = rng.choice(list('<>"=/ 0x\n-'))
        try:
            Robot(urdf="".join(letters[: rng.integers(1, len(letters) + 1)]), bodies="none")
        except InputError as error:
            refused += 1
            assert "\n" not in str(error)
    assert refused > 100


@pytest.mark.parametrize("name", ["no_such_robot", "./missing.urdf", "arm.xacro"])
def test_unknown_names_are_refused(name: str) -> None:
    with pytest.raises(InputError):
        load_robot(name)


def test_nearest_name_is_suggested() -> None:
    with pytest.raises(InputError, match="did you mean"):
        load_robot("tallos")


TETRAHEDRON = ((0.0, 0.0, 0.0), (0.2, 0.0, 0.0), (0.0, 0.2, 0.0), (0.0, 0.0, 0.2))


def stl(path: Path, scale: float = 1.0, triangles: int | None = None, corners: Any = TETRAHEDRON) -> None:
    """Write a tetrahedron as binary STL."""
    corners = scale * np.array(corners)
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    path.write_bytes(
        bytes(80)
        + struct.pack("<I", len(faces) if triangles is None else triangles)
        + b"".join(struct.pack("<12fH", 0, 0, 0, *corners[list(face)].ravel(), 0) for face in faces)
    )


def test_meshes_come_from_package_directories_alone(tmp_path: Path) -> None:
    package = tmp_path / "arm_description"
    package.mkdir()
    outside = tmp_path / "outside.stl"
    stl(outside)
    stl(package / "ok.stl")
    (package / "linked.stl").symlink_to(outside)
    urdf = package / "arm.urdf"
    for name, accepted in (
        ("package://arm_description/ok.stl", True),
        ("ok.stl", True),
        ("linked.stl", False),
        ("../outside.stl", False),
        (str(outside), False),
        ("package://other/ok.stl", False),
    ):
        urdf.write_text(text(link("a", f'<mesh filename="{name}"/>')))
        if accepted:
            assert load_robot(urdf).body_names == ("a_0",)
            assert load_robot(urdf, package_dirs=[tmp_path]).body_names == ("a_0",)
        else:
            with pytest.raises(InputError, match="bodies="):
                load_robot(urdf)
    assert load_robot(urdf, bodies="none").body_names == ()
    (tmp_path / "packages" / "other").mkdir(parents=True)
    stl(tmp_path / "packages" / "other" / "ok.stl")
    assert load_robot(urdf, package_dirs=[tmp_path / "packages"]).body_names == ("a_0",)
    stl(package / "ok.stl", triangles=10**6)
    urdf.write_text(text(link("a", '<mesh filename="ok.stl"/>')))
    with pytest.raises(InputError, match="1,000,000 triangles"):
        load_robot(urdf)


CORNERS = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.obj", f"mtllib /etc/passwd\n{CORNERS}f 1 2 3\n", "a file beside the mesh"),
        ("a.obj", f"{CORNERS}f {'1 2 3 ' * 20_000}\n", "a line of 120,002 bytes"),
        ("a.obj", f"{CORNERS.replace('v 1', 'v nan')}f 1 2 3\n", "coordinates up to"),
        ("a.dae", "<COLLADA><node><instance_node/></node></COLLADA>", "nodes that place other nodes"),
        ("a.dae", '<!DOCTYPE a [<!ENTITY b "c">]><COLLADA/>', "DOCTYPE"),
        ("a.txt", CORNERS, "a mesh (.stl, .obj, .dae)"),
    ],
)
def test_meshes_that_harm_a_native_reader_are_refused(
    tmp_path: Path, name: str, content: str, words: str
) -> None:
    """They hang the reader, or have it open other files."""
    (tmp_path / name).write_text(content)
    (tmp_path / "arm.urdf").write_text(text(link("a", f'<mesh filename="{name}"/>')))
    with pytest.raises(InputError) as caught:
        load_robot(tmp_path / "arm.urdf")
    assert words in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("flat", [False, True])
def test_meshes_collide_like_those_of_pinocchio(tmp_path: Path, flat: bool) -> None:
    """A flat mesh has no convex hull."""
    stl(
        tmp_path / "a.stl", 2.0, corners=[[0, 0, 0], [0.2, 0, 0], [0, 0.2, 0], [0.2, 0.2, 0 if flat else 0.2]]
    )
    stl(tmp_path / "c.stl")
    shapes = {
        "a": '<mesh filename="a.stl"/>',
        "b": '<sphere radius="0.01"/>',
        "c": '<mesh filename="c.stl"/>',
    }
    parts = [link(name, shape) for name, shape in shapes.items()]
    parts += [joint(m, n, m, "continuous", "", z=0.2) for n, m in ("ab", "bc")]
    (tmp_path / "r.urdf").write_text(text(*parts))
    robot = load_robot(tmp_path / "r.urdf")
    q = configurations(robot, 100, 3.0)
    model, data, geometry = robot.model, robot.model.createData(), robot.geometry
    geometry_data = pin.GeometryData(geometry)
    hit = [pin.computeCollisions(model, data, geometry, geometry_data, one, False) for one in q]
    assert (robot.collisions(q).hit == hit).all() and 0 < sum(hit) < len(q)


def test_every_published_robot_loads() -> None:
    """Those of example-robot-data; its alex_psyonic_hands names joints to mimic that do not exist."""
    loaded = set()
    for name in robot_names():
        try:
            robot = load_robot(name, bodies="none")
        except InputError as error:
            assert "mimic" in str(error)
            continue
        loaded.add(name)
        assert len(robot.configuration_names) == len(robot.units) == robot.model.nq
    assert {"figure", "human", "g1", "talos", "panda", "icub", "pr2"} <= loaded and len(loaded) > 80


def test_roots(tmp_path: Path) -> None:
    free = Robot(urdf=ALL_KINDS, bodies="none")
    assert free.free_flyer and free.configuration_names[:7] == ("x", "y", "z", "qx", "qy", "qz", "qw")
    assert not Robot(urdf=ALL_KINDS, fixed_base=True).free_flyer
    floating = text(link("world", ""), link("a"), joint("base", "world", "a", "floating", "", z=0.0))
    robot = Robot(urdf=floating)
    assert robot.model.nq == 7 and robot.configuration_names == free.configuration_names[:7]
    # A floating joint that another joint carries is no root.
    carried = Robot(urdf=text(*map(link, "abc"), joint("i", "a", "b"), joint("f", "b", "c", "floating", "")))
    assert carried.model.nq == 15 and carried.configuration_names[7:9] == ("i", "f.x")


def test_a_pickled_robot_is_the_same() -> None:
    robot = Robot(urdf=ALL_KINDS, name="kinds")
    other = pickle.loads(pickle.dumps(robot))
    assert other.collision_pairs == robot.collision_pairs and other.model == robot.model


# --- mimics and columns


def test_mimics_are_followed() -> None:
    robot = Robot(urdf=ALL_KINDS, fixed_base=True)
    q = robot.with_mimics(np.tile(robot.neutral, (2, 1)) + 0.0)
    names = robot.configuration_names
    q[:, names.index("hinge")] = 0.3
    errors = dict(zip([one.joint for one in robot.mimics], robot.mimic_errors(q).T, strict=True))
    assert np.allclose(errors["follower"], 0.1 - (-2 * 0.3 + 0.1))
    q = robot.with_mimics(q)
    assert np.allclose(robot.mimic_errors(q), 0)
    assert np.allclose(q[:, names.index("second")], -2 * (-2 * 0.3 + 0.1) + 0.1)


def test_columns_in_any_order_give_q() -> None:
    robot = Robot(urdf=ALL_KINDS)
    q = robot.with_mimics(configurations(robot, 5))
    q[:, robot.configuration_names.index("turn_joint.cos")] = np.cos(7.0)
    q[:, robot.configuration_names.index("turn_joint.sin")] = np.sin(7.0)
    order = np.random.default_rng(0).permutation(robot.model.nq)
    names = [robot.configuration_names[k].upper() for k in order]
    back, notes = robot.q_from_columns(names, q[:, order])
    assert np.allclose(back, q) and notes == ()
    # A continuous joint as one angle, without the columns of mimicking joints.
    kept = [n for n in robot.configuration_names if not n.startswith(("turn", "follower", "second"))]
    values = np.column_stack([*(q[:, robot.configuration_names.index(n)] for n in kept), np.full(5, 7.0)])
    back, notes = robot.q_from_columns([*kept, "turn"], values)
    assert np.allclose(back, q) and notes == ()


def test_missing_and_foreign_columns_are_said() -> None:
    robot = Robot(urdf=ALL_KINDS, fixed_base=True)
    q, notes = robot.q_from_columns(["hinge_joint", "slide", "time"], np.full((2, 3), 0.5))
    assert (q[:, robot.configuration_names.index("hinge")] == 0.5).all()
    assert any("turn_joint.cos" in note and "neutral" in note for note in notes) and any(
        "time" in note for note in notes
    )
    for names in (["a", "b", "c"], ["hinge", "hinge", "slide"], []):
        with pytest.raises(InputError):
            robot.q_from_columns(names, np.zeros((2, len(names))))


def test_configurations_are_checked() -> None:
    robot = Robot(urdf=ALL_KINDS)
    q = configurations(robot, 3)
    rounded = np.round(q, 3)
    assert np.allclose(np.linalg.norm(robot.checked(rounded)[:, 3:7], axis=1), 1)
    for bad in (q[:, 1:], np.where(q == q[0, 0], np.nan, q), q * np.where(np.arange(q.shape[1]) == 6, 3, 1)):
        with pytest.raises(InputError):
            robot.checked(bad)


# --- kinematics


@pytest.mark.parametrize("name", ["figure", "human", "g1", "kinds"])
def test_points_and_jacobians_are_those_of_pinocchio(name: str) -> None:
    from posekit.robots.kinematics import Kinematics, Site

    robot = Robot(urdf=ALL_KINDS) if name == "kinds" else load_robot(name, bodies="none")
    model, data = robot.model, robot.model.createData()
    offset = (0.1, -0.2, 0.3)
    joints = range(1, model.njoints)
    kinematics = Kinematics(model, [Site(joint, offset) for joint in joints])
    q = configurations(robot, 4)
    points, jacobians = kinematics.jacobians(q)
    assert np.allclose(points, kinematics.positions(q))
    for n in range(len(q)):
        pin.computeJointJacobians(model, data, q[n])
        for k, joint in enumerate(joints):
            assert np.allclose(points[n, k], data.oMi[joint].act(np.array(offset)))
            J = pin.getJointJacobian(model, data, joint, pin.LOCAL_WORLD_ALIGNED)
            arm = data.oMi[joint].rotation @ np.array(offset)
            assert np.allclose(jacobians[n, k], J[:3] - pin.skew(arm) @ J[3:], atol=1e-9)


@pytest.mark.parametrize("name", ["figure", "human", "g1", "talos", "simple_humanoid", "icub", "romeo"])
def test_joint_maps_stand_for_a_body(name: str) -> None:
    """At neutral the body is its own mirror image, and hips are above knees above ankles."""
    robot = load_robot(name, bodies="none")
    neck, r_shoulder, l_shoulder, pelvis, *rest = robot.points(robot.neutral)[0]
    right, left = np.array([r_shoulder, *rest[::2]]), np.array([l_shoulder, *rest[1::2]])
    across = (right - left) / np.linalg.norm(right - left, axis=1)[:, None]
    assert (across @ across[0] > 0.9).all()
    up = neck - pelvis
    hips, knees, ankles = right[1], right[4], right[5]
    assert (hips - knees) @ up > 0 and (knees - ankles) @ up > 0 and (neck - hips) @ up > 0


def test_an_arm_is_no_humanoid(tmp_path: Path) -> None:
    arm = load_robot("panda", bodies="none", fixed_base=True)
    assert np.isnan(arm.points(arm.neutral)).all()
    with pytest.raises(InputError, match="joint map"):
        arm.configurations(np.zeros((14, 3)))
    # Its files are judged by their configurations.
    np.savez(tmp_path / "arm.npz", q=np.tile(arm.neutral, (20, 1)))
    report = posekit.validate(tmp_path / "arm.npz", urdf=arm)
    assert report.ok.all() and "joint-range" in report.checks


def test_a_file_of_an_arm_is_judged_like_its_array(tmp_path: Path) -> None:
    validator = Validator("panda")
    q = np.repeat(validator.robot.neutral[None], 20, axis=0)
    q[:, 7:] += 0.005 * np.arange(20)[:, None]
    path = tmp_path / "arm.csv"
    np.savetxt(path, q, delimiter=",", header=",".join(validator.configuration_names), comments="")
    report = posekit.validate(path, urdf="panda")
    assert report.invalid.tolist() == validator.check(q).invalid.tolist() and report.invalid.any()
    assert report.not_asked["sliding"] == "no joint positions are known"


def test_velocities_are_differences() -> None:
    robot = Robot(urdf=ALL_KINDS)
    q = configurations(robot, 3)
    v = robot.velocities(q, np.array([0.0, 0.5, 0.6]))
    assert np.allclose(pin.integrate(robot.model, q[1], 0.1 * v[1]), q[2], atol=1e-9)


# --- collisions


@pytest.mark.parametrize("reach", [0.15, 1.0])
def test_verdicts_of_meshes_are_those_of_pinocchio(g1: Robot, reach: float) -> None:
    q = configurations(g1, 150, reach)
    geometry: Any = g1.geometry
    data, geometry_data = g1.model.createData(), geometry.createData()
    found = g1.collisions(q)
    pairs: list[list[int]] = [[] for _ in q]
    for frame, pair in zip(found.frame, found.pair, strict=True):
        pairs[frame].append(pair)
    for n in range(len(q)):
        pin.computeCollisions(g1.model, data, geometry, geometry_data, q[n], False)
        touching = [k for k, result in enumerate(geometry_data.collisionResults) if result.isCollision()]
        assert sorted(pairs[n]) == touching and found.hit[n] == bool(touching)
    assert 0 < found.hit.sum() < len(q) and (found.distance < 0).all()


def test_distances_of_primitives_are_those_of_pinocchio() -> None:
    shapes = [
        '<sphere radius="0.1"/>',
        '<capsule radius="0.08" length="0.2"/>',
        '<box size="0.1 0.2 0.3"/>',
        '<cylinder radius="0.1" length="0.2"/>',
    ]
    parts = [link(f"l{k}", shapes[k % 4]) for k in range(8)]
    parts += [joint(f"j{k}", f"l{k}", f"l{k + 1}", "continuous", "", z=0.15) for k in range(7)]
    robot = Robot(urdf=text(*parts))
    geometry: Any = robot.geometry
    data, geometry_data = robot.model.createData(), geometry.createData()
    q = configurations(robot, 60, 2.0)
    margin = 0.05
    found = robot.collisions(q, margin=margin)
    listed = {(n, k): d for n, k, d in zip(found.frame, found.pair, found.distance, strict=True)}
    for n in range(len(q)):
        pin.computeDistances(robot.model, data, geometry, geometry_data, q[n])
        for k, result in enumerate(geometry_data.distanceResults):
            if result.min_distance < margin - 1e-5:
                assert listed[n, k] == pytest.approx(result.min_distance, abs=3e-5)
            elif result.min_distance > margin + 1e-5:
                assert (n, k) not in listed
    assert {n for (n, _), d in listed.items() if d <= 0} == set(np.flatnonzero(found.hit))


def test_a_larger_margin_lists_more(g1: Robot) -> None:
    q = configurations(g1, 20, 0.3)
    near, far = g1.collisions(q), g1.collisions(q, margin=0.03)
    assert set(zip(near.frame, near.pair, strict=True)) < set(zip(far.frame, far.pair, strict=True))
    assert (near.hit == far.hit).all() and (far.distance <= 0.03).all()


def test_the_order_of_configurations_does_not_matter(g1: Robot) -> None:
    q = configurations(g1, 300, 0.3)
    order = np.random.default_rng(0).permutation(len(q))
    assert (g1.collisions(q[order]).hit == g1.collisions(q).hit[order]).all()


def test_a_configuration_is_judged_alike_in_any_call(g1: Robot) -> None:
    """Depths agree within the tolerance of coal, which starts from the pair's query before."""
    q, validator = configurations(g1, 320, 0.2), Validator(g1)
    together, alone = validator.check(q), validator.check(q[:8])
    np.testing.assert_allclose(alone.worst, together.worst[:8], atol=1e-5)
    assert (alone.ok == together.ok[:8]).all()


def test_capsules_stand_in_for_absent_meshes() -> None:
    human = load_robot("human", bodies="capsules")
    assert {"torso_1", "hips", "right_thigh", "left_forearm"} <= set(human.body_names)
    q = np.tile(human.neutral, (2, 1))
    names = human.configuration_names
    q[1, names.index("left_shoulder_Z")], q[1, names.index("left_elbow_Z")] = 0.3, 2.4
    q[1, names.index("left_shoulder_Y")] = -1.5
    assert not human.collisions(q[:1]).hit[0]
    arm = text(
        *(link(n, f'<mesh filename="package://none/{n}.stl"/>') for n in "abcd"),
        *(joint(f"j{n}", n, m, inside=LIMIT.replace("2", "3.1")) for n, m in ("ab", "bc", "cd")),
    )
    robot = Robot(urdf=arm, bodies="capsules", fixed_base=True)
    report = Validator(robot).check(robot.neutral)
    assert robot.body_names == () and "no bodies" in report.not_asked["collision"]
    with pytest.raises(InputError, match="package_dirs"):
        Robot(urdf=arm)


def test_pairs_of_an_srdf() -> None:
    urdf = text(*map(link, "abc"), joint("i", "a", "b"), joint("j", "b", "c"))
    srdf = '<robot name="r"><disable_collisions link1="a" link2="b"/><disable_collisions link1="c" link2="b"/></robot>'
    robot = Robot(urdf=urdf, srdf=srdf)
    assert robot.collision_pairs == (("a_0", "c_0"),)
    # Variants of a robot share an SRDF: links of others are passed over, an SRDF of another robot is refused.
    assert Robot(urdf=urdf, srdf=srdf.replace('"c"', '"z"')).collision_pairs == (
        ("a_0", "c_0"),
        ("b_0", "c_0"),
    )
    with pytest.raises(InputError, match="link"):
        Robot(urdf=urdf, srdf='<robot name="r"><disable_collisions link1="x" link2="y"/></robot>')
    # Without an SRDF neighbours are left out, and bodies that touch at neutral.
    assert Robot(urdf=urdf).collision_pairs == (("a_0", "c_0"),)
    assert Robot(urdf=urdf.replace('"0.1"/>', '"0.5"/>')).collision_pairs == ()


# --- inverse kinematics and scaling


@pytest.mark.parametrize("name", ["figure", "human", "g1"])
def test_reachable_joints_are_reached_inside_the_limits(name: str) -> None:
    robot = load_robot(name, bodies="none")
    q = configurations(robot, 12, 0.4)
    joints = robot.points(q) @ pin.rpy.rpyToMatrix(0.3, -0.5, 2.0).T + 3.0
    found, distance = robot.configurations(joints)
    assert np.median(distance) < 1e-4 and (distance < 5e-3).mean() > 0.9
    assert np.allclose(np.linalg.norm(robot.points(found) - joints, axis=2).max(axis=1), distance)
    assert (found >= robot.lower).all() and (found <= robot.upper).all()


def test_unknown_joints_are_left_out() -> None:
    human = load_robot("human", bodies="none")
    joints = human.points(configurations(human, 3, 0.3))
    joints[0, 8], joints[1] = np.nan, np.nan
    q, distance = human.configurations(joints)
    assert np.isfinite(q).all() and distance[0] < 1e-3 and np.isnan(distance[1]) and distance[2] < 1e-3


def test_a_start_is_kept_where_the_points_do_not_tell() -> None:
    human = load_robot("human", bodies="none")
    q = configurations(human, 4, 0.2)
    found, distance = human.configurations(human.points(q), start=q)
    assert np.allclose(found, q, atol=1e-6) and (distance < 1e-6).all()


def test_configurations_depend_on_their_own_posture() -> None:
    human = load_robot("human", bodies="none")
    joints = human.points(configurations(human, 5, 0.6)) * 1.02
    q, distance = human.configurations(joints)
    for k, posture in enumerate(joints):
        alone, off = human.configurations(posture)
        assert np.allclose(alone[0], q[k], atol=1e-6) and np.allclose(off[0], distance[k], atol=1e-6)


def test_mimicking_joints_follow_in_inverse_kinematics(tmp_path: Path) -> None:
    """A chain whose second hinge follows the first reaches what it can reach."""
    (tmp_path / "map.toml").write_text(
        'schema = "posekit.joint_map/1"\n[points]\n'
        'pelvis = "a"\nneck = "b"\nright_shoulder = {frame = "e", offset = [0.1, 0.2, 0.3]}\nleft_shoulder = "f"\n'
        'right_hip = "c"\nleft_hip = "d"\n'
    )
    robot = Robot(urdf=ALL_KINDS, joint_map_file=str(tmp_path / "map.toml"))
    q = robot.with_mimics(configurations(robot, 5, 0.1))
    points = robot.points(q)
    assert np.isfinite(points).all(axis=2).sum(axis=1).tolist() == [6] * 5
    found, distance = robot.configurations(points)
    assert (distance < 1e-3).all() and np.allclose(robot.mimic_errors(found), 0, atol=1e-9)
    human = load_robot("human", bodies="none", joint_map=tmp_path / "map.toml")
    with pytest.raises(InputError, match="a frame of the model"):
        human.points(human.neutral)
    # A given map is used by every door.
    settings = ValidateSettings(joint_map=str(tmp_path / "map.toml"))
    with pytest.raises(InputError, match="a frame of the model"):
        Validator("human", settings=settings).check(np.zeros((2, 14, 3)))


@pytest.mark.parametrize("name", ["human", "g1"])
def test_a_scaled_robot_has_the_lengths_of_a_person(name: str) -> None:
    from posekit.robots.scaling import segment_lengths

    figure, robot = load_robot("figure", bodies="none"), load_robot(name, bodies="none")
    joints = figure.points(configurations(figure, 8, 0.3))
    person = robot.scaled(joints)
    neutral = person.points(pin.neutral(person.model))
    assert np.allclose(segment_lengths(neutral), segment_lengths(joints), atol=1e-9)
    if name == "human":  # its trunk bends where the figure's does
        assert np.median(person.configurations(joints)[1]) < 1e-3
    with pytest.raises(InputError, match="metres"):
        robot.scaled(1000 * joints)
