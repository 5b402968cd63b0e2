"""The folder of a person as a robot: Pinocchio alone, yourdfpy, MuJoCo and pandas give the joints back."""

import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pandas
import pinocchio as pin
import pytest

from posekit.body import load_figure
from posekit.errors import FigureError, InputError
from posekit.formats.motion.motion import Motion
from posekit.formats.motion.urdf_folder import (
    CSV_FILE,
    FIGURE_FILE,
    FOLDER_FILES,
    LINK_OF,
    MUJOCO_FILE,
    NPZ_FILE,
    URDF_FORMAT,
    read_urdf_folder,
    write_urdf_folder,
)
from posekit.formats.own.postures_q import read_configurations
from posekit.skeleton import DOFS, POINTS, urdf_joint_name

PERSON = load_figure().scaled(
    {
        "neck-right_shoulder": 0.19,
        "neck-left_shoulder": 0.22,
        "right_shoulder-pelvis": 0.49,
        "right_hip-right_knee": 0.41,
    }
)
EXACT = 1e-12


def configurations(rng: np.random.Generator, n: int) -> np.ndarray:
    q = np.tile(pin.neutral(PERSON.model), (n, 1))
    q[:, :3] = rng.normal(size=(n, 3)) + np.array([0, 0, 4])
    turn = rng.normal(size=(n, 4))
    q[:, 3:7] = turn / np.linalg.norm(turn, axis=1, keepdims=True)
    limits = PERSON.limits
    q[:, PERSON.angle_index] = limits.lower + rng.random((n, 22)) * (limits.upper - limits.lower)
    return q


@pytest.fixture
def q(rng: np.random.Generator) -> np.ndarray:
    return configurations(rng, 15)


@pytest.fixture
def folder(q: np.ndarray, tmp_path: Path) -> Path:
    write_urdf_folder(tmp_path / "person", PERSON, q, np.arange(15) / 30)
    return tmp_path / "person"


@pytest.fixture
def trusting(monkeypatch: pytest.MonkeyPatch) -> None:
    """Load the figure without the child process that looks at a stranger's file first: it takes seconds."""
    monkeypatch.setattr(
        "posekit.formats.motion.urdf_folder.load_figure", partial(load_figure, untrusted=False)
    )


class TestOtherProgramsOpenIt:
    def test_pinocchio_alone(self, folder: Path, q: np.ndarray) -> None:
        model = pin.buildModelFromUrdf(str(folder / FIGURE_FILE), pin.JointModelFreeFlyer())
        data = model.createData()
        with np.load(folder / NPZ_FILE) as archive:
            stored, names = archive["q"], archive["configuration_names"].tolist()
        assert names[7:] == list(model.names)[2:]
        for row, expected in zip(stored, PERSON.forward_kinematics(q), strict=True):
            pin.framesForwardKinematics(model, data, row)
            for k, point in enumerate(POINTS):
                place = data.oMf[model.getFrameId(LINK_OF[point])].translation
                np.testing.assert_allclose(place, expected[k], rtol=0, atol=EXACT)
        geometry = pin.buildGeomFromUrdf(model, str(folder / FIGURE_FILE), pin.GeometryType.COLLISION)
        assert len(geometry.geometryObjects) == len(PERSON.capsules)

    def test_yourdfpy_and_the_table(self, folder: Path, q: np.ndarray) -> None:
        yourdfpy = pytest.importorskip("yourdfpy")
        robot = yourdfpy.URDF.load(str(folder / FIGURE_FILE), load_meshes=False)
        table = pandas.read_csv(folder / CSV_FILE)
        assert list(table.columns) == ["time", *PERSON.configuration_names]
        np.testing.assert_array_equal(table["time"], np.arange(15) / 30)
        for (_, row), expected in zip(table.iterrows(), PERSON.forward_kinematics(q), strict=True):
            robot.update_cfg({urdf_joint_name(dof): row[urdf_joint_name(dof)] for dof in DOFS})
            local = np.array([robot.get_transform(LINK_OF[point], "torso")[:3, 3] for point in POINTS])
            R = pin.Quaternion(np.array([row["qx"], row["qy"], row["qz"], row["qw"]])).toRotationMatrix()
            place = local @ R.T + [row["x"], row["y"], row["z"]]
            np.testing.assert_allclose(place, expected, rtol=0, atol=EXACT)

    def test_mujoco(self, folder: Path, q: np.ndarray) -> None:
        mujoco = pytest.importorskip("mujoco")
        model = mujoco.MjModel.from_xml_path(str(folder / MUJOCO_FILE))
        assert model.njnt == 1 + len(DOFS)
        assert model.ngeom == len(PERSON.capsules)
        data = mujoco.MjData(model)
        root = model.joint("root").qposadr[0]
        for row, expected in zip(q, PERSON.forward_kinematics(q), strict=True):
            data.qpos[root : root + 7] = row[[0, 1, 2, 6, 3, 4, 5]]
            for name, angle in zip(PERSON.configuration_names[7:], row[7:], strict=True):
                data.qpos[model.joint(name).qposadr[0]] = angle
            mujoco.mj_kinematics(model, data)
            for k, point in enumerate(POINTS):
                np.testing.assert_allclose(data.body(LINK_OF[point]).xpos, expected[k], rtol=0, atol=EXACT)

    def test_the_projects_own_readers(self, folder: Path, q: np.ndarray) -> None:
        assert load_figure(folder / FIGURE_FILE).hash == PERSON.hash
        stored = read_configurations(folder / NPZ_FILE)
        np.testing.assert_array_equal(stored.in_order_of(PERSON.configuration_names), q)
        points = read_urdf_folder(folder).points
        np.testing.assert_allclose(points, PERSON.forward_kinematics(q), rtol=0, atol=EXACT)


@pytest.mark.usefixtures("trusting")
class TestRoundTrip:
    def test_points_are_forward_kinematics(self, folder: Path, q: np.ndarray) -> None:
        motion = read_urdf_folder(folder)
        assert motion.names == POINTS
        np.testing.assert_allclose(motion.points, PERSON.forward_kinematics(q), rtol=0, atol=EXACT)
        np.testing.assert_array_equal(motion.time, np.arange(15) / 30)
        assert motion.rate == pytest.approx(30)
        assert motion.up == "+z"
        assert isinstance(read_urdf_folder(folder, "m"), Motion)

    def test_what_is_not_known_stays_so(self, q: np.ndarray, tmp_path: Path) -> None:
        elbow = PERSON.configuration_names.index("left_elbow_flexion")
        q[3, elbow] = np.nan
        write_urdf_folder(tmp_path / "a", PERSON, q, np.arange(15.0), up="-y")
        assert np.isnan(pandas.read_csv(tmp_path / "a" / CSV_FILE)["left_elbow_flexion"][3])
        motion = read_urdf_folder(tmp_path / "a")
        unknown = np.argwhere(np.isnan(motion.points).all(axis=-1))
        assert unknown.tolist() == [[3, POINTS.index("left_wrist")]]
        assert motion.up == "-y"

    def test_one_frame(self, q: np.ndarray, tmp_path: Path) -> None:
        write_urdf_folder(tmp_path / "a", PERSON, q[:1], np.array([2.5]))
        motion = read_urdf_folder(tmp_path / "a")
        assert (len(motion), motion.time[0]) == (1, 2.5)

    def test_written_twice_gives_the_same_bytes(self, folder: Path, q: np.ndarray) -> None:
        before = {name: (folder / name).read_bytes() for name in FOLDER_FILES}
        write_urdf_folder(folder, PERSON, q, np.arange(15) / 30)
        assert {name: (folder / name).read_bytes() for name in FOLDER_FILES} == before
        assert sorted(path.name for path in folder.parent.iterdir()) == ["person"]


@pytest.mark.usefixtures("trusting")
class TestBadInput:
    def test_a_folder_with_something_else_is_kept(self, q: np.ndarray, tmp_path: Path) -> None:
        (tmp_path / "a").mkdir()
        (tmp_path / "a" / "thesis.tex").write_text("years")
        with pytest.raises(InputError, match=r"a folder that holds thesis\.tex"):
            write_urdf_folder(tmp_path / "a", PERSON, q, np.arange(15.0))
        assert sorted(path.name for path in tmp_path.rglob("*")) == ["a", "thesis.tex"]

    def test_a_file_is_no_folder(self, q: np.ndarray, tmp_path: Path) -> None:
        (tmp_path / "a").write_text("x")
        with pytest.raises(InputError, match="got a file"):
            write_urdf_folder(tmp_path / "a", PERSON, q, np.arange(15.0))
        with pytest.raises(InputError, match="a folder with"):
            read_urdf_folder(tmp_path / "a")

    def test_a_place_that_is_not_there(self, q: np.ndarray, tmp_path: Path) -> None:
        with pytest.raises(InputError, match="No such file"):
            write_urdf_folder(tmp_path / "no" / "a", PERSON, q, np.arange(15.0))
        assert list(tmp_path.iterdir()) == []

    def test_wrong_q_leaves_nothing(self, q: np.ndarray, tmp_path: Path) -> None:
        for wrong, says in ((q[:, :5], "q: got shape"), (q * np.nan, "got nan")):
            with pytest.raises(InputError, match=says):
                write_urdf_folder(tmp_path / "a", PERSON, wrong, np.arange(15.0))
        with pytest.raises(InputError, match="time"):
            write_urdf_folder(tmp_path / "a", PERSON, q, np.arange(14.0))
        assert list(tmp_path.iterdir()) == []

    @pytest.mark.parametrize(
        ("damage", "says"),
        [
            (lambda folder: (folder / NPZ_FILE).unlink(), "a folder with"),
            (lambda folder: (folder / FIGURE_FILE).unlink(), "a folder with"),
            (lambda folder: (folder / NPZ_FILE).write_bytes(b"PK\x03\x04 no"), "configurations.npz"),
            (lambda folder: change(folder, q=lambda q: q[:, :20]), "20 columns, 29 names"),
            (lambda folder: change(folder, q=lambda q: q * np.inf), "got nan|got -?inf"),
            (lambda folder: change(folder, q=lambda q: q * 2), "quaternion of length 2"),
            (lambda folder: change(folder, time=lambda time: time[::-1]), r"time\[1\]"),
            (
                lambda folder: change(folder, configuration_names=lambda names: np.full(29, "x")),
                "those of the figure",
            ),
            (lambda folder: change(folder, up=lambda up: np.array("up")), "up: got"),
            (
                lambda folder: (folder / FIGURE_FILE).write_text("<robot name='a'><link name='b'/></robot>"),
                "not a stick figure",
            ),
        ],
    )
    def test_a_damaged_folder(
        self, damage: Callable[[Path], object], says: str, folder: Path, q: np.ndarray
    ) -> None:
        damage(folder)
        with pytest.raises((InputError, FigureError), match=says) as caught:
            read_urdf_folder(folder)
        assert "\n" not in str(caught.value)

    def test_columns_are_found_by_name(self, folder: Path, q: np.ndarray) -> None:
        turn = np.arange(29)[::-1]
        change(folder, q=lambda q: q[:, turn], configuration_names=lambda names: names[turn])
        motion = read_urdf_folder(folder)
        np.testing.assert_allclose(motion.points, PERSON.forward_kinematics(q), rtol=0, atol=EXACT)

    def test_metres_alone(self, folder: Path) -> None:
        with pytest.raises(InputError, match="a figure is in metres"):
            read_urdf_folder(folder, "mm")

    def test_registered(self, folder: Path) -> None:
        assert URDF_FORMAT.suffixes == ()
        assert URDF_FORMAT.write_configurations is write_urdf_folder
        shutil.rmtree(folder)


def change(folder: Path, **changes: Callable[[np.ndarray], np.ndarray]) -> None:
    """Write the NPZ again with some arrays changed."""
    with np.load(folder / NPZ_FILE) as archive:
        arrays = {name: archive[name] for name in archive.files}
    for name, alter in changes.items():
        arrays[name] = alter(arrays[name])
    np.savez(folder / NPZ_FILE, **arrays)
