"""Every door takes a path, an array or an object, and refuses what it cannot use in one line."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
import pytest

import posekit
from posekit.batch import batch
from posekit.doors import view_of
from posekit.samples import samples
from posekit.settings import RecoverSettings, ValidateSettings, number


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made: Path = tmp_path_factory.mktemp("doors")
    samples(made)
    return made


def test_importing_posekit_loads_no_library() -> None:
    code = "import sys, posekit; print([m for m in ('numpy', 'pinocchio', 'scipy', 'click') if m in sys.modules])"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


def test_public_names_are_few_and_all_load() -> None:
    assert len(posekit.__all__) <= 25
    for name in posekit.__all__:
        assert getattr(posekit, name).__doc__, name
    assert set(posekit.__all__) <= set(dir(posekit))


def test_recover_takes_a_path_and_an_opened_view(folder: Path) -> None:
    by_path = posekit.recover(folder / "walk.json")
    by_view = posekit.recover(posekit.open(folder / "walk.json"))
    assert len(by_path) == len(by_view) == 5
    assert np.array_equal(by_path.survivors.joints, by_view.survivors.joints)
    assert len(by_path[-1].joints) > 0


def test_recover_takes_statures_and_tolerances_as_text_or_numbers(folder: Path) -> None:
    camera = f"{folder / 'calibration.toml'}:cam_01"
    view = posekit.open(folder / "keypoints")
    text = posekit.recover(view, camera=camera, stature="175cm", deviation="2px", rate=10)
    numbers = posekit.recover(view, camera=camera, stature=1.75, deviation=2, rate=10)
    assert np.array_equal(text.survivors.joints, numbers.survivors.joints)


def test_recover_takes_key_points_as_an_array_in_the_order_of_a_layout(folder: Path) -> None:
    files = sorted((folder / "keypoints").glob("*.json"))[:2]
    people = [json.loads(file.read_text())["people"][0]["pose_keypoints_2d"] for file in files]
    points = np.reshape(people, (2, 25, 3))
    known: dict[str, Any] = {"camera": f"{folder / 'calibration.toml'}:cam_01", "stature": 1.75, "rate": 10}
    found = posekit.recover(points, layout="body_25", **known)
    of_files = posekit.recover(folder / "keypoints", **known)
    assert np.array_equal(found.survivors.joints, of_files.survivors.joints[: len(found.survivors)])
    two = np.stack([np.full_like(points, np.nan), points], axis=1)  # two people, of whom one is never seen
    assert np.array_equal(posekit.recover(two, **known).survivors.joints, found.survivors.joints)
    with pytest.raises(posekit.InputError, match=r"shape \(2, 75\); expected key points \(T, P, 2\)"):
        posekit.recover(points.reshape(2, -1))


def test_every_door_takes_an_array_in_the_order_of_a_layout(folder: Path, tmp_path: Path) -> None:
    joints = posekit.open(folder / "jump.bvh").figure_joints[:5]
    smpl = posekit.open(joints, "posekit_14", rate=30, up="+z")
    assert np.array_equal(smpl.joints, joints)
    assert np.array_equal(posekit.repair(joints, layout="posekit_14", rate=30, up="+z").motion.joints, joints)
    posekit.convert(joints, tmp_path / "jump.npz", layout="posekit_14", rate=30, up="+z")
    assert np.array_equal(posekit.open(tmp_path / "jump.npz").joints, joints)
    posekit.render(joints[:, ::-1], tmp_path / "jump.html", layout="posekit_14")
    assert posekit.open(joints[..., :2], "posekit_14").points.shape == (5, 14, 2)


def test_configurations_are_judged_by_their_urdf_and_by_ranges_where_they_are_asked_for() -> None:
    model = posekit.load_figure().model
    rng = np.random.default_rng(0)
    q = np.tile(posekit.load_figure().neutral, (50, 1))
    q[:, 7:] = rng.uniform(model.lowerPositionLimit[7:], model.upperPositionLimit[7:], (50, model.nq - 7))
    by_urdf = posekit.Validator(checks=["joint-range"]).check(q)
    settings = ValidateSettings(ranges="anatomical", checks=["joint-range"])
    asked = posekit.Validator(settings=settings).check(q)
    assert by_urdf.ok.all() and not asked.ok.all()
    again = posekit.Validator(ranges="anatomical", checks=["joint-range"]).check(q)
    assert np.array_equal(asked.ok, again.ok)


@pytest.mark.parametrize("values", [[[1.0, 2.0], [3.0]], np.array([["a", "b"]])])
def test_a_list_that_is_no_array_is_refused_by_every_door(values: Any, tmp_path: Path) -> None:
    def refused(door: Callable[..., Any], *arguments: Any) -> None:
        with pytest.raises(posekit.InputError, match=r"^(?!.*\n)"):
            door(values, *arguments)

    for door in (posekit.open, posekit.validate, posekit.repair, posekit.recover):
        refused(door)
    refused(posekit.convert, tmp_path / "a.npz")
    refused(posekit.render, tmp_path / "a.html")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("body", ["figure", "g1"])
def test_a_validator_has_the_model_that_judges(body: str) -> None:
    validator = posekit.Validator(body)
    assert isinstance(validator.model, pinocchio.Model)
    assert validator.model.nq == len(validator.configuration_names)


@pytest.mark.parametrize("name", ["jump.bvh", "walk.npz"])
def test_validate_gives_the_same_verdicts_for_a_path_an_object_and_an_array(folder: Path, name: str) -> None:
    motion = posekit.open(folder / name)
    by_path = posekit.validate(folder / name)
    by_motion = posekit.validate(motion)
    assert np.array_equal(by_path.ok, by_motion.ok)
    both = np.concatenate([motion.figure_joints, motion.head], axis=1)
    by_array = posekit.validate(both, rate=motion.rate, up=motion.up, checks="joint-range")
    by_check = posekit.validate(motion, checks="joint-range")
    assert np.array_equal(by_array.ok, by_check.ok)


def test_a_view_that_is_drawn_or_recovered_must_be_one(folder: Path) -> None:
    with pytest.raises(posekit.InputError, match=r"walk\.npz.*motion; expected a view or key points"):
        posekit.recover(folder / "walk.npz")
    with pytest.raises(posekit.InputError, match="cameras"):
        posekit.render(folder / "calibration.toml", folder / "x.png")
    with pytest.raises(posekit.InputError, match=r"cam_2.*cam_01"):
        posekit.recover(folder / "keypoints", camera=f"{folder / 'calibration.toml'}:cam_2")


@pytest.mark.parametrize(
    "target", ["walk.trc", "walk.c3d", "walk.csv", "walk.bvh", "walk.json", "walk.parquet"]
)
def test_convert_keeps_the_joints(folder: Path, tmp_path: Path, target: str) -> None:
    source = posekit.open(folder / "walk.npz")
    posekit.convert(folder / "walk.npz", tmp_path / target)
    found = posekit.open(tmp_path / target)
    if source.up != found.up and found.up:
        source = source.rotated(found.up)
    assert np.allclose(found.figure_joints, source.figure_joints, atol=2e-3, equal_nan=True)


@pytest.mark.parametrize(
    ("text", "value"),
    [("175cm", 1.75), ("1750mm", 1.75), ("1.75m", 1.75), (1.75, 1.75), ("2px", 2.0), ("3%", 0.03)],
)
def test_quantities_may_carry_their_unit(text: Any, value: float) -> None:
    assert number(text, "stature") == value


@pytest.mark.parametrize("text", ["", "tall", "nan", "inf", "1,75", "5ft9"])
def test_what_is_no_quantity_is_refused(text: str) -> None:
    with pytest.raises(posekit.InputError, match="stature"):
        number(text, "stature")


@pytest.mark.parametrize("kind", [RecoverSettings, ValidateSettings])
def test_settings_survive_json_and_refuse_unknown_fields(kind: Any) -> None:
    settings = kind(checks="joint-range,collision", ranges="table1", contact_margin="-2cm")
    assert settings.checks == ("joint-range", "collision")
    assert settings.contact_margin == -0.02
    assert kind(**settings.to_json()).to_json() == settings.to_json()
    with pytest.raises(posekit.InputError, match="did you mean ranges"):
        settings.changed(range="table1")


def test_settings_are_read_from_toml(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('coverage = 1.0\nstature = "180cm"\n', encoding="utf-8")
    assert RecoverSettings.from_toml(path).stature == 1.8
    path.write_text("coverage = 2.0\n", encoding="utf-8")
    with pytest.raises(posekit.InputError, match="coverage"):
        RecoverSettings.from_toml(path)


class BentElbow:
    """The right elbow is bent by less than 40 degrees."""

    name, unit, reads = "bent-elbow", "deg", ("joints",)

    def angle(self, joints: Any) -> Any:
        upper, fore = joints[:, 6] - joints[:, 1], joints[:, 8] - joints[:, 6]
        cosine = (upper * fore).sum(axis=1) / np.linalg.norm(upper, axis=1) / np.linalg.norm(fore, axis=1)
        return np.degrees(np.arccos(np.clip(cosine, -1, 1)))[:, None]

    def judge(self, body: Any) -> posekit.Judgement:
        return posekit.Judgement(("right_elbow",), self.angle(body.joints))

    def residuals(self, joints: Any) -> Any:
        return np.maximum(40.0 - self.angle(joints), 0.0) / 0.5


class Impossible(BentElbow):
    """No elbow is as this check requires."""

    def judge(self, body: Any) -> posekit.Judgement:
        return posekit.Judgement(("right_elbow",), self.angle(body.joints), lower=200.0)


def test_an_own_check_with_residuals_pulls_noisy_postures(folder: Path) -> None:
    from posekit.synthesis import mocap_view, with_noise

    rng = np.random.default_rng(3)
    view = with_noise(mocap_view(posekit.open(folder / "walk.npz"), rng, frames=4), 2.0, rng)
    usual = ["rigid-parts", "joint-range"]
    free = posekit.recover(view, checks=usual).survivors.joints
    pulled = posekit.recover(view, checks=[*usual, BentElbow()]).survivors.joints
    assert np.median(BentElbow().angle(free)) < 35
    assert len(pulled)
    assert BentElbow().angle(pulled).min() > 38


STANDING = np.repeat(posekit.load_figure().neutral_points[None, :14], 20, axis=0)

#: Doors that take an array of joints, and facts about it.
FACT_DOORS = {
    "validate": lambda folder, **facts: posekit.validate(STANDING, **facts).decision,
    "repair": lambda folder, **facts: posekit.repair(STANDING, **facts).report.decision,
    "open": lambda folder, **facts: posekit.open(STANDING, "posekit_14", **facts).rate,
    "convert": lambda folder, **facts: posekit.convert(STANDING, folder / "x.csv", **facts),
    "render": lambda folder, **facts: posekit.render(STANDING, folder / "x.html", **facts),
}


@pytest.mark.parametrize("door", FACT_DOORS)
class TestFactsAboutAnArray:
    def test_spelling_does_not_matter(self, door: str, tmp_path: Path) -> None:
        exact, loose = tmp_path / "exact", tmp_path / "loose"
        exact.mkdir()
        loose.mkdir()
        same = FACT_DOORS[door](exact, rate=30.0, up="+z", unit="m")
        assert FACT_DOORS[door](loose, rate="30 Hz", up="Z", unit="M") == same
        for written in exact.iterdir():
            assert (loose / written.name).read_bytes() == written.read_bytes()

    @pytest.mark.parametrize(
        ("name", "fact"),
        [
            *(("rate", wrong) for wrong in (0, -1.0, np.nan, "fast", [30])),
            *(("up", wrong) for wrong in ("w", 3)),
            *(("unit", wrong) for wrong in ("parsec", 1)),
        ],
    )
    def test_an_impossible_fact_is_refused_by_its_name(
        self, door: str, name: str, fact: Any, tmp_path: Path
    ) -> None:
        with pytest.raises(posekit.InputError, match=f"^{name}: "):
            FACT_DOORS[door](tmp_path, **{"rate": 30.0, name: fact})
        assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("call", "names"),
    [
        (lambda: posekit.validate(STANDING, rate=30, checks=3), "checks"),
        (lambda: posekit.validate(STANDING, rate=30, ranges=3), "ranges"),
        (lambda: posekit.validate(STANDING, rate=30, profile=3), "profile"),
        (lambda: posekit.validate(STANDING, rate=30, urdf=3), "urdf"),
        (lambda: posekit.recover(np.ones((1, 17, 2)), layout="coco_17", camera=np.eye(3)), "camera"),
        (lambda: posekit.recover(np.ones((1, 17, 2)), layout="coco_17", size="wide"), "size"),
        (lambda: posekit.recover(np.ones((1, 17, 2)), layout="coco_17", rate=0), "rate"),
        (lambda: posekit.validate(STANDING, 3), "settings"),
        (lambda: posekit.validate(STANDING, posekit.RecoverSettings()), "settings"),
        (lambda: posekit.recover(np.ones((1, 17, 2)), 3, layout="coco_17"), "settings"),
        (lambda: posekit.recover(posekit.builtin_view("seq1"), figure="nobody.urdf"), "nobody.urdf"),
        (lambda: posekit.Tracker(3, size=(1280, 720)), "settings"),
        (lambda: posekit.Tracker(camera="calibration.toml"), "camera"),
        (lambda: posekit.Tracker(size="1280x720").update("points", 0.0), "points"),
        (lambda: posekit.Tracker(size="1280x720").update(np.ones((14, 2)), "now"), "time"),
        (lambda: posekit.View(camera=3, time=[0], image=np.ones((1, 14, 2))), "camera"),
        (lambda: posekit.save({"cam": 1}, "cameras.toml"), "cameras"),
        (lambda: posekit.render(None, "x.html"), "NoneType"),
        (lambda: posekit.render(STANDING, "x.svg", which="angel"), "angles"),
        (lambda: posekit.render(STANDING, "x.png", azimuth="left"), "azimuth"),
        (lambda: batch(3, "results"), "inputs"),
        (lambda: batch(["walk.json"], "results", 3), "settings"),
        (lambda: posekit.render(STANDING, "x.png", frame="last"), "frame"),
        (lambda: posekit.render(STANDING, "x.png", size=(0, 10)), "size"),
    ],
)
def test_an_argument_of_another_kind_is_refused_by_its_name(call: Any, names: str) -> None:
    with pytest.raises(posekit.InputError, match=names):
        call()


def test_text_stands_for_frames_and_sizes_as_on_the_command_line(folder: Path, tmp_path: Path) -> None:
    posekit.render(folder / "walk.npz", tmp_path / "page.html", frame=(2, 5))
    numbers = (tmp_path / "page.html").read_bytes()
    posekit.render(folder / "walk.npz", tmp_path / "page.html", frame="2-5", size="640x480")
    assert (tmp_path / "page.html").read_bytes() == numbers
    coco = np.ones((1, 17, 2)) * np.arange(17)[:, None]
    guess = posekit.recover(coco, layout="coco_17", fov=60, size="1280x720")
    assert guess.camera == posekit.recover(coco, layout="coco_17", fov=60, size=(1280, 720)).camera


def test_configurations_are_converted_and_drawn(tmp_path: Path) -> None:
    robot = posekit.Validator("g1").robot
    q = np.tile(robot.neutral, (3, 1))
    posekit.convert(q, tmp_path / "g1.csv", urdf="g1", rate=50)
    posekit.render(q, tmp_path / "g1.html", urdf="g1")
    assert '"number":2' in (tmp_path / "g1.html").read_text()
    again = posekit.open(tmp_path / "g1.csv", urdf="g1")
    np.testing.assert_allclose(again.q, q, atol=1e-9)
    assert again.rate == pytest.approx(50)


def test_the_figure_is_the_robot_of_its_validator() -> None:
    validator = posekit.Validator()
    assert validator.robot is validator.figure
    assert validator.check(validator.robot.neutral).ok.all()


def test_rows_of_a_robot_have_z_up_and_the_order_of_their_layout() -> None:
    q = np.tile(posekit.Validator("g1").robot.neutral, (30, 1))
    q[:, 2] = 0.79
    good = posekit.validate(q, urdf="g1", rate=50)
    assert good.ok.all()
    assert not good.not_asked  # the ground, too, is judged: z of a URDF's world points up
    mujoco = q[:, [0, 1, 2, 6, 3, 4, 5, *range(7, q.shape[1])]]
    turned = posekit.validate(mujoco, urdf="g1", rate=50)
    assert "orientation" in turned.clips[0].reason  # upside down: the quaternion has another order
    read = posekit.validate(mujoco, urdf="g1", rate=50, layout="robot_qpos")
    np.testing.assert_allclose(read.worst, good.worst, atol=1e-9)


def test_one_posture_follows_a_layout_as_a_batch_of_one_does() -> None:
    posture = np.random.default_rng(0).normal(size=(22, 3))
    one = posekit.validate(posture, layout="smpl_22")
    np.testing.assert_array_equal(one.worst, posekit.validate(posture[None], layout="smpl_22").worst)


def test_files_without_a_suffix_are_no_clips(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "walk.npz").write_bytes((folder / "walk.npz").read_bytes())
    (tmp_path / "README").touch()
    assert posekit.validate(tmp_path).decision == "keep 1 of 1 clip"


@pytest.mark.parametrize(
    ("call", "wrong", "meant"),
    [
        (posekit.validate, "fps", "rate"),
        (posekit.repair, "check", "checks"),
        (posekit.recover, "fov_deg", "fov"),
        (posekit.recover, "height", "stature"),
        (posekit.render, "resolution", "size"),
        (posekit.convert, "units", "unit"),
        (posekit.open, "skeleton", "layout"),
        (posekit.Validator, "robot", "urdf"),
        (posekit.assert_valid, "limits", "ranges"),
        (posekit.Tracker, "intrinsics", "camera"),
    ],
)
def test_an_unknown_argument_is_refused_with_the_one_that_is_meant(call: Any, wrong: str, meant: str) -> None:
    with pytest.raises(posekit.InputError, match=rf"{wrong}: .*did you mean {meant}\?"):
        call(STANDING, **{wrong: 1})


@pytest.mark.parametrize(
    ("name", "words", "exact"),
    [
        ("unit", ("meters", "Metres", "metre"), "m"),
        ("unit", ("inches", "inch"), "in"),
        ("unit", ("centimetres", "CM"), "cm"),
        ("up", ("y-up", "Y_UP", "yup", "y"), "+y"),
    ],
)
def test_words_for_units_and_axes_are_understood(name: str, words: tuple[str, ...], exact: str) -> None:
    factor = {"in": 1 / 0.0254, "cm": 100.0}.get(exact, 1.0)
    found = posekit.open(STANDING * factor, "posekit_14", **{name: exact})
    for word in words:
        same = posekit.open(STANDING * factor, "posekit_14", **{name: word})
        assert (same.unit, same.up, same.notes) == (found.unit, found.up, found.notes)
        np.testing.assert_array_equal(same.joints, found.joints)


@pytest.mark.parametrize(
    ("text", "value"),
    [("1.75 metres", 1.75), ("70 Inches", 1.778), ("6 feet", 1.8288), ("30 hertz", 30.0), ("2 PIXELS", 2.0)],
)
def test_quantities_may_have_words_for_their_unit(text: str, value: float) -> None:
    assert number(text, "quantity") == pytest.approx(value, abs=1e-12)


def test_an_array_in_another_order_of_axes_is_refused_with_the_order() -> None:
    for wrong in (np.zeros((50, 3, 22)), np.zeros((50, 3, 14))):
        with pytest.raises(posekit.InputError, match=r"\(frames, points, 3\).*transpose\(0, 2, 1\)"):
            posekit.validate(wrong)
    for empty in (np.zeros((0, 22, 3)), np.zeros((0, 14, 3))):
        with pytest.raises(posekit.InputError, match=r"a frame or more|no frame"):
            posekit.validate(empty, rate=30)
    with pytest.raises(posekit.InputError, match="key points; expected postures or motion"):
        posekit.validate(np.zeros((50, 17, 2)), layout="coco_17")


def test_none_is_an_unknown_number_through_every_door() -> None:
    gap = STANDING.tolist()
    gap[3][6] = [None, None, None]
    same = STANDING.copy()
    same[3, 6] = np.nan
    assert np.array_equal(posekit.validate(gap, rate=30).verdicts, posekit.validate(same, rate=30).verdicts)
    assert np.isnan(posekit.Motion(joints=gap).joints[3, 6]).all()
    assert posekit.Tracker(size="1280x720").update([[None, None]] * 14, 0.0).survivors == 0


def test_the_usual_checks_and_one_more() -> None:
    usual = posekit.validate(STANDING, rate=30, up="+z")
    more = posekit.validate(STANDING, rate=30, up="+z", checks=["usual", BentElbow()])
    assert [name for name in more.checks if name != "bent-elbow"] == list(usual.checks)
    assert "bent-elbow" in more.checks
    assert posekit.Validator(checks="usual, collision").check(STANDING[0]).checks == (
        *("rigid-parts", "joint-range", "collision"),
    )


def test_quaternions_of_another_order_are_a_doubt_about_a_batch() -> None:
    validator, angle = posekit.Validator("g1"), np.linspace(-0.4, 0.4, 20)
    q = np.tile(validator.robot.neutral, (20, 1))
    q[:, 5], q[:, 6] = np.sin(angle), np.cos(angle)
    other = q[:, [0, 1, 2, 6, 3, 4, 5, *range(7, q.shape[1])]]
    assert not validator.check(q).warnings
    assert "w, x, y, z" in validator.check(other).warnings[0]
    assert not validator.check(other[:1]).warnings  # one posture is just another orientation
    posekit.assert_valid(q, "g1")
    with pytest.warns(UserWarning, match="w, x, y, z"):
        posekit.assert_valid(other, "g1")
    # The model `human` stands along y.
    assert not posekit.validate(STANDING, up="+z", urdf="human").warnings


def test_a_robot_that_is_fitted_to_people_is_named(folder: Path) -> None:
    report = posekit.validate([folder / "jump.bvh", folder / "robot.npz"], urdf="g1")
    assert [note for note in report.notes if "is fitted to these positions" in note] == [
        "jump.bvh: g1 is fitted to these positions; judge people without --urdf"
    ]


def test_random_points_are_not_repairable() -> None:
    points = np.random.default_rng(0).normal(size=(60, 14, 3))
    clip = posekit.validate(points, rate=30, up="+z").clips[0]
    assert clip.decision == "drop" and clip.invalid == 60


def test_a_report_is_read_only_and_has_a_table_of_clips(folder: Path) -> None:
    report = posekit.validate([folder / "jump.bvh", folder / "walk.npz"])
    for values in (report.ok, report.worst, report.margins, report.frame, report.findings["value"]):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 0
    clips = report.to_pandas(clips=True)
    assert clips["decision"].tolist() == ["repair?", "keep"]
    assert clips["reason"].tolist() == ["teleport", ""]
    assert clips["frames"].tolist() == [90, 90]


def test_key_points_are_drawn_as_the_postures_behind_them(folder: Path, tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="30 pictures a second are assumed"):
        posekit.render(folder / "keypoints", tmp_path / "page.html")
    assert (tmp_path / "page.html").stat().st_size > 10_000


def test_an_empty_result_is_not_drawn_or_converted_but_says_why(tmp_path: Path) -> None:
    none = posekit.recover(posekit.builtin_view("seq1"), checks=[Impossible()])
    for target in ("x.html", "x.png", "x.trc", "x.bvh"):
        door = posekit.render if target.endswith(("html", "png")) else posekit.convert
        with pytest.raises(posekit.InputError, match=r"no posture: \w+"):
            door(none, tmp_path / target)
    assert not list(tmp_path.iterdir())


def test_findings_in_an_array_are_numbered_by_its_rows() -> None:
    postures = STANDING.copy()
    postures[[3, 7], 8] += 1.0  # the right wrist is torn off
    for report in (posekit.validate(postures), posekit.Validator().check(postures)):
        assert set(report.table()["frame"]) == {3, 7} == set(np.flatnonzero(~report.ok))
    with pytest.raises(AssertionError, match="frame 3"):
        posekit.assert_valid(postures)


def test_assert_valid_judges_a_file_by_its_own_robot(folder: Path) -> None:
    with pytest.raises(AssertionError, match="left_elbow_joint"):
        posekit.assert_valid(folder / "robot.npz")


MADE: dict[str, Any] = {name: getattr(posekit, name) for name in ("Motion", "ValidateSettings", "Judgement")}


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: MADE["Motion"](joints=STANDING, joint_name=()), r"Motion: joint_name: .*joint_names"),
        (lambda: MADE["ValidateSettings"](tolerance=1), r"tolerance: .*rigid_tolerance"),
        (lambda: MADE["Judgement"](places=(), values=[]), r"Judgement: values: .*did you mean value\?"),
        (lambda: posekit.Motion(joints=np.zeros((2, 17, 3))), "name them, one row per frame"),
        (lambda: posekit.validate(True), "bool|true|shape"),
        (lambda: posekit.validate(np.zeros((5, 14, 3), complex)), "complex128"),
        (lambda: posekit.recover(np.ones((1, 17, 2)), layout="COCO"), "did you mean coco_1"),
        (lambda: posekit.recover(np.ones((1, 25, 2)), layout="openpose"), "did you mean body_25"),
        (lambda: posekit.recover(np.ones((1, 17, 2)), layout="coco_17", fov="wide", size="9x9"), "fov"),
        (
            lambda: posekit.save(posekit.Motion(joints=STANDING), "x.csv", rate=30),
            "rate: got an unknown argument",
        ),
        (lambda: posekit.validate(STANDING, checks=[len]), r"with @posekit\.check"),
        (lambda: posekit.validate(STANDING, checks="joint_ranges"), "^checks: .*did you mean joint-range"),
    ],
)
def test_a_slip_is_answered_by_what_is_meant(call: Any, says: str) -> None:
    with pytest.raises(posekit.InputError, match=says):
        call()


def test_facts_of_pictures_are_used(folder: Path) -> None:
    """Points that are fractions of a picture need its size; a field of view may be text."""
    found = posekit.open(folder / "keypoints")
    fractions = replace(found, points=found.points / (1280, 720))
    with pytest.raises(posekit.InputError, match="give the size"):
        view_of(fractions, rate=10)
    text = view_of(fractions, rate=10, fov="60 degrees", size="1280x720")
    pixels = view_of(found, rate=10, fov=60, size=(1280, 720))
    assert repr(text.camera) == repr(pixels.camera)
    np.testing.assert_allclose(text.image, pixels.image, atol=1e-9)


def test_a_stated_unit_is_the_unit_of_the_written_file(folder: Path, tmp_path: Path) -> None:
    posekit.save(posekit.open(folder / "jump.bvh"), tmp_path / "jump.bvh", unit="inches")
    offsets = [
        line.split()[2] for line in (tmp_path / "jump.bvh").read_text().splitlines() if "OFFSET" in line
    ]
    assert 10 < max(abs(float(one)) for one in offsets) < 25  # a thigh in inches


def test_a_file_that_is_named_twice_is_judged_once(folder: Path) -> None:
    assert posekit.validate([folder / "walk.npz"] * 2).decision == "keep 1 of 1 clip"


def test_an_empty_path_is_not_the_present_folder() -> None:
    for door in (posekit.validate, posekit.open, posekit.recover):
        with pytest.raises(posekit.InputError, match=r"no file|a folder"):
            door("")


@pytest.mark.parametrize("rules", [1, "1", [1], "1,"])
def test_rules_may_be_one_number(rules: Any) -> None:
    assert ValidateSettings(rules=rules).rules == (1,)


@pytest.mark.parametrize(("name", "value"), [("strict", "no"), ("rules", "one"), ("rules", 7)])
def test_a_word_is_not_taken_for_true(name: str, value: Any) -> None:
    with pytest.raises(posekit.InputError, match=f"^{name}: "):
        ValidateSettings(**{name: value})
