"""Both versions of results are read; written are the set, what is not listed, and the digits that there are."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posekit
from posekit.answers import Answer
from posekit.errors import InputError
from posekit.formats.own import Inferred, PostureSet, Result, View, read_postures, read_result, write_result
from posekit.formats.own.column import columns_in
from posekit.formats.own.digits import FEWEST_DECIMALS
from posekit.formats.own.frame_answer import FrameAnswer
from posekit.formats.own.units import UNIT_NAMES
from posekit.inspection.results import result_lines
from posekit.recovery.recovered import recovered_with
from posekit.recovery.recovery import Recovery
from posekit.recovery.result import MAX_DETAILED, result_of
from posekit.validators import Validator

EARLIER = Path(__file__).parent / "earlier"


@pytest.fixture(scope="module")
def noisy(walking: View) -> Recovery:
    """Recover two frames that are two pixels off."""
    names = ("time", "image", "truth", "head_image", "confidence")
    two = {name: getattr(walking, name)[:2] for name in names}
    two["image"] = two["image"] + np.random.default_rng(2).normal(size=two["image"].shape) * 2
    two["head_image"] = np.full_like(two["head_image"], np.nan)
    return posekit.recover(replace(walking, **two, root=two["truth"][:, 0], deviation=2.0))


@pytest.fixture(scope="module")
def exact(walking: View) -> Recovery:
    """Recover frames whose image is exact."""
    return posekit.recover(walking)


def read_back(folder: Path, result: Result, suffix: str) -> Result:
    write_result(folder / f"r.{suffix}", result)
    return read_result(folder / f"r.{suffix}")


@pytest.mark.parametrize("suffix", ["json", "npz"])
@pytest.mark.parametrize("kind", ["exact", "refined"])
def test_results_of_the_first_version_are_read_and_written_as_the_second(tmp_path, kind, suffix):
    path = EARLIER / f"{kind}_result_1.{suffix}"
    result = read_result(path)
    assert [len(frame) for frame in result.frames] == [2, 2]
    assert {frame.posture_set for frame in result.frames} == {None}
    np.testing.assert_array_equal(
        read_postures(path).joints, np.concatenate([frame.joints for frame in result.frames])
    )
    back = read_back(tmp_path, result, suffix)
    for one, other in zip(result.frames, back.frames, strict=True):
        off = 0.0 if one.precision is None else 10.0**-one.precision.decimals
        np.testing.assert_allclose(one.joints, other.joints, rtol=0, atol=off)
        np.testing.assert_allclose(one.q, other.q, rtol=0, atol=off)


def test_both_forms_of_the_first_version_say_the_same():
    for kind in ("exact", "refined"):
        a, b = (read_result(EARLIER / f"{kind}_result_1.{suffix}") for suffix in ("json", "npz"))
        for one, other in zip(a.frames, b.frames, strict=True):
            np.testing.assert_array_equal(one.joints, other.joints)
            np.testing.assert_array_equal(one.q, other.q)
            assert one.branches == other.branches


@pytest.mark.parametrize("suffix", ["json", "npz"])
@pytest.mark.parametrize("unit", ["m", "cm", "mm"])
def test_the_set_of_an_exact_frame_is_read_to_the_bit(tmp_path, exact, suffix, unit):
    back = read_back(tmp_path, result_of(exact, unit=unit), suffix)
    for frame, read in zip(exact.frames, back.frames, strict=True):
        assert read.unlisted == 0 and read.unlisted_probability == 0
        made: Any = read.posture_set
        np.testing.assert_allclose(made.trunks, frame.posture_set.trunks, rtol=0 if unit == "m" else 3e-16)
        assert made.bodies == frame.posture_set.bodies == len(made.compose())
        np.testing.assert_array_equal(made.excluded, frame.posture_set.excluded)
        np.testing.assert_allclose(read.q, frame.q, rtol=0)
        listed = {one.round(9).tobytes() for one in read.joints}
        assert {one.round(9).tobytes() for one in made.joints(made.compose())} >= listed


def test_json_and_npz_of_noisy_frames_agree_to_the_digits_that_they_have(tmp_path, noisy):
    result = result_of(noisy)
    a, b = (read_back(tmp_path, result, suffix) for suffix in ("json", "npz"))
    for frame, one, other in zip(noisy.frames, a.frames, b.frames, strict=True):
        deviation = np.sqrt(np.nanmedian(np.diagonal(frame.refined.covariance, axis1=-2, axis2=-1)))
        read: Any
        for read in (one, other):
            assert np.abs(read.joints - frame.joints).max() < deviation / 10
            assert read.unlisted == frame.unlisted
            np.testing.assert_allclose(read.refined.chi2, frame.refined.chi2, rtol=1e-4)
            assert abs(read.probability.sum() - 1) < 1e-4
            assert read.posture_set.bodies == frame.posture_set.bodies
            np.testing.assert_array_equal(read.posture_set.compose(), frame.posture_set.compose())
            np.testing.assert_allclose(
                read.posture_set.limb_joints, frame.posture_set.limb_joints, atol=deviation / 10
            )


def test_noisy_frames_in_millimetres_take_fewer_bytes_than_in_metres(tmp_path, noisy):
    size = {}
    for unit in UNIT_NAMES:
        path = tmp_path / f"{unit}.json"
        write_result(path, replace(result_of(noisy), unit=unit))
        size[unit] = path.stat().st_size
        for one, frame in zip(read_result(path).frames, noisy.frames, strict=True):
            assert np.abs(one.joints - frame.joints).max() <= 10.0**-FEWEST_DECIMALS
    assert size["mm"] < size["cm"] < size["m"]


@pytest.mark.parametrize("suffix", ["json", "npz"])
def test_configurations_of_few_digits_are_placed(tmp_path, noisy, suffix):
    """Pinocchio would place a quaternion that is none of unit length without a word: the figure refuses it."""
    for frame in read_back(tmp_path, result_of(noisy), suffix).frames:
        told = np.isfinite(frame.q).all(axis=1)
        placed = noisy.figure.forward_kinematics(frame.q[told])[:, :14]
        # The figure's own lengths stand for what refinement varied.
        assert np.linalg.norm(placed - frame.joints[told], axis=2).max() < 0.1


@pytest.mark.parametrize("suffix", ["json", "npz"])
def test_answers_are_read_back(tmp_path, noisy, suffix):
    back = read_back(tmp_path, result_of(noisy), suffix)
    for answer, read in zip(noisy.answers, back.frames, strict=True):
        said: Any = read.answer
        np.testing.assert_array_equal(said.representatives, answer.rows)
        np.testing.assert_allclose(said.probability, answer.probability, rtol=1e-3)
        np.testing.assert_allclose(said.near, answer.depth.near, rtol=1e-3, atol=1e-12)
        np.testing.assert_allclose(said.region_level, answer.regions.level, rtol=1e-3)
        assert same_region(answer, said)


def same_region(answer: Answer, said: FrameAnswer) -> bool:
    """Say whether the likeliest mode of each joint is where it was, to what its deviations leave open."""
    off = np.abs(said.region_mean[0] - answer.regions.mean[:, 0])
    deviation = np.sqrt(np.diagonal(said.region_covariance[0], axis1=-2, axis2=-1))
    return bool((off < np.maximum(deviation, 1e-3)).all())


def test_a_result_that_lists_a_part_details_few(noisy):
    frame: Any
    for frame, answer in zip(result_of(noisy).frames, noisy.answers, strict=True):
        told = np.isfinite(frame.q).all(axis=1)
        assert told.sum() == min(MAX_DETAILED, len(answer))
        assert told[answer.rows[0]]
        np.testing.assert_array_equal(np.isfinite(frame.refined.covariance).any(axis=(1, 2, 3)), told)
        assert np.isfinite(frame.refined.chi2).all() and np.isfinite(frame.joints).all()


def test_a_result_that_lists_everything_details_everything(noisy):
    settings = noisy.settings | {"asked": noisy.settings["asked"] | {"coverage": 1.0}}
    frame: Any
    for frame in result_of(replace(noisy, settings=settings)).frames:
        assert np.isfinite(frame.q).all() and np.isfinite(frame.refined.covariance).all()


def test_details_that_a_posture_lacks_are_left_out_of_the_json(tmp_path, noisy):
    write_result(tmp_path / "r.json", result_of(noisy))
    for frame in json.loads((tmp_path / "r.json").read_text())["frames"]:
        some = [posture for posture in frame["postures"] if "q" not in posture]
        assert len(some) == len(frame["postures"]) - min(
            MAX_DETAILED, len(frame["answer"]["representatives"])
        )
        for posture in some:
            assert set(posture) == {"joints", "branches", "probability", "refined"}
            assert set(posture["refined"]) == {"chi2", "dof", "merged"}


@pytest.mark.parametrize("suffix", ["json", "npz"])
def test_what_was_certified_is_valid_when_it_is_read(tmp_path, noisy, suffix):
    back = read_back(tmp_path, result_of(noisy), suffix)
    assert back.decimals == min(frame.precision.decimals for frame in back.frames if frame.precision)
    said = recovered_with(back)
    validator = Validator(said.figure, settings=said.settings)
    for frame in back.frames:
        assert len(frame)
        assert "invalid" not in validator.check(frame.joints).verdicts


def test_inspect_says_what_sets_are_made_of_and_what_is_not_listed(noisy, exact):
    told = "\n".join(result_lines(result_of(noisy)))
    unlisted = sum(frame.unlisted for frame in noisy.frames)
    assert unlisted and f"{unlisted} at most are not listed" in told
    assert "all whole postures are listed" in "\n".join(result_lines(result_of(exact)))


def test_a_set_in_an_npz_that_is_damaged_is_refused(tmp_path, exact):
    write_result(tmp_path / "r.npz", result_of(exact))
    with np.load(tmp_path / "r.npz") as arrays:
        content = dict(arrays)
    counts = content["set/counts"].copy()
    counts[0, 0] = -1
    for name, values in (("set/counts", counts), ("set/limb_trunk", content["set/limb_trunk"] + 100)):
        np.savez_compressed(tmp_path / "other.npz", **(content | {name: values}))
        with pytest.raises(InputError, match="set"):
            read_result(tmp_path / "other.npz")


def test_columns_of_sets_and_answers_say_what_they_mean():
    for table in (PostureSet, FrameAnswer):
        assert all(column.meaning.endswith(".") for column in columns_in(table).values())


@pytest.mark.parametrize("suffix", ["json", "npz"])
def test_frames_in_which_nothing_was_inferred_are_not_counted_as_inferred(tmp_path, noisy, suffix):
    result = result_of(noisy)
    first, second = result.frames
    wrist = Inferred(kind="region", lower=np.zeros(3), upper=np.ones(3), radius=1.0)
    nothing = replace(second, inferred=[{} for _ in range(len(second))])
    one = replace(first, inferred=[{"right_wrist": wrist}, *({} for _ in range(len(first) - 1))])
    back = read_back(tmp_path, replace(result, frames=[one, nothing]), suffix)
    assert "joints not seen, and inferred in 1 frame: right_wrist" in result_lines(back)
