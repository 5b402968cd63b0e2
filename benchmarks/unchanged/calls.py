"""The corpus's calls from Python: run as a script, ``calls.py NAME [FILE…]``, by the environment that is recorded.

Only names of `posekit` itself are used. What a call returns goes into ``answer.json``, or into files of posekit's.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

import posekit

NAMED_CALLS: dict[str, Callable[..., Any]] = {}


def call(function: Callable[..., Any]) -> Callable[..., Any]:
    NAMED_CALLS[function.__name__] = function
    return function


def plain(value: Any) -> Any:
    """Return a value as JSON can hold it: an array with its type and shape."""
    if isinstance(value, np.ndarray):
        return {"dtype": str(value.dtype), "shape": list(value.shape), "values": value.ravel().tolist()}
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Mapping):
        return {str(key): plain(one) for key, one in value.items()}
    if isinstance(value, (str, int, float, bool, type(None))):
        return value
    if isinstance(value, Iterable):
        return [plain(one) for one in value]
    return str(value)


def fields(thing: Any, names: str) -> dict[str, Any]:
    """Return some of a thing's fields; None where it has no such one."""
    return {name: getattr(thing, name, None) for name in names.split()}


def frames(recovery: Any) -> list[Any]:
    names = "joints q margins rejected groups fk_distance length_residual time reason"
    return [fields(frame, names) | {"pruned": len(frame.pruned())} for frame in recovery.frames]


@call
def names() -> Any:
    return {name: type(getattr(posekit, name)).__name__ for name in posekit.__all__}


@call
def recover_built_in() -> Any:
    recovery = posekit.recover(posekit.builtin_view("seq2"), group=0.05)
    first = recovery.frames[0]
    pruned = [fields(one, "branch joint reason value lower upper unit") for one in first.pruned()]
    posekit.write_result("result.json", posekit.result_of(recovery, unit="cm", explain=True))
    return {"frames": frames(recovery), "pruned": pruned, "probability": recovery.probability}


@call
def recover_options() -> Any:
    view = posekit.builtin_view("seq1")
    tolerance = posekit.Tolerance(rigid=0.02, tangent=0.01, placement=False, angle=1.0)
    walking = ("rigid-parts", "joint-range", "collision", "walking")
    asked: list[dict[str, Any]] = [
        {"checks": walking},
        {"ranges": "table1", "contact_margin": 0.005},
        {"tolerance": tolerance},
        {"figure": posekit.load_figure(), "group": 0.1},
        {"checks": walking, "rules": (1, 2, 3, 4, 5), "walkers": "people"},
    ]
    return [frames(posekit.recover(view, **options)) for options in asked]


@call
def recover_refined(path: str) -> Any:
    recovery = posekit.recover(posekit.read_view(path))
    refined = [fields(frame.refined, "chi2 dof p covariance merged") for frame in recovery.frames]
    return {"frames": frames(recovery), "refined": refined, "probability": recovery.probability}


@call
def follow(path: str) -> Any:
    for home in ("posekit", "posekit.recovery", "posekit.pipeline"):  # no name of posekit's own at first
        try:
            following = import_module(home).follow
            break
        except (AttributeError, ImportError):
            continue
    paths = following(posekit.recover(posekit.read_view(path)), k=3)
    return fields(paths, "time survivor joints interpolated deviation cost lead share branches scale exact")


@call
def figure() -> Any:
    figure = posekit.load_figure()
    tall = figure.from_stature(1.82).scaled({"right_hip-right_knee": 0.45})
    q = np.zeros((3, len(figure.configuration_names)))
    q[:, 6] = 1.0
    q[:, 7:] += np.linspace(0.0, 0.1, 3)[:, None]
    answer = {
        name: fields(one, "lengths limits configuration_names head_points")
        for name, one in (("built in", figure), ("tall", tall))
    }
    return answer | {"joints": figure.forward_kinematics(q)}


def judged(report: Any) -> Any:
    judgements = [
        fields(one, "check where unit value lower upper margin violated") for one in report.judgements
    ]
    return fields(report, "verdicts valid invalid undecided worst fk_distance q") | {"judgements": judgements}


def torn() -> Any:
    joints = np.concatenate([frame.joints for frame in posekit.recover(posekit.builtin_view("seq1")).frames])[
        ::9
    ].copy()
    joints[0, 9] += [0.0, 0.0, 0.3]
    joints[1, 13] = np.nan
    return joints


@call
def validator() -> Any:
    joints = torn()
    built_in = posekit.Validator(strict=True)
    table1 = posekit.Validator(
        strict=True, checks=("joint-range", "walking"), ranges="table1", rules=(1, 2, 3, 4, 5)
    )
    return [judged(built_in.check(joints)), judged(table1.check(joints)), built_in.describe()]


@call
def validator_human() -> Any:
    return judged(posekit.Validator("human").check(torn()))


@call
def robot_q(name: str) -> Any:
    """Judge configurations around zero, and write them for `posekit validate`."""
    validator = posekit.Validator(name, checks=("joint-range", "collision"))
    names = list(validator.configuration_names)
    q = np.random.default_rng(5).uniform(-1.5, 1.5, (6, len(names)))
    if "qw" in names:
        q[:, : names.index("qw") + 1] = 0.0
        q[:, names.index("qw")] = 1.0
    q[0] *= [float(name == "qw") for name in names]
    content = {"schema": "posekit.configurations/1", "configuration_names": names, "q": q.tolist()}
    Path("q.json").write_text(json.dumps(content))
    np.savez("q.npz", q=q, configuration_names=np.array(names))
    return judged(validator.check(q=q)) | {"names": names}


@call
def files(view: str, result: str, postures: str) -> Any:
    """Read files of posekit's own and write them again, in another unit or as an NPZ."""
    posekit.write_view("view.json", posekit.read_view(view), unit="mm")
    read = posekit.read_result(result)
    posekit.write_result("result.npz", read)
    posekit.write_result("result.json", posekit.read_result("result.npz"))
    given = posekit.read_postures(postures)
    posekit.write_postures("postures.npz", given)
    posekit.write_postures("postures.json", given, unit="cm")
    return {
        "postures": fields(given, "joints head"),
        "frames": len(read.frames),
        "names": read.configuration_names,
    }


@call
def cameras(*paths: str) -> Any:
    wanted = "name K distortion fisheye size R t up how deviation"
    return {
        path: {name: fields(one, wanted) for name, one in posekit.read_cameras(path).items()}
        for path in paths
    }


@call
def keypoints(*paths: str) -> Any:
    wanted = "format pictures frame points size time person confidence occluded score sequence"
    return {path: fields(posekit.read_keypoints(path), wanted) for path in paths}


@call
def motion(*paths: str) -> Any:
    return {
        path: fields(posekit.read_motion(path), "names points time rate up clip clips actions")
        for path in paths
    }


@call
def open_views(path: str) -> Any:
    source = posekit.Source(fov=65.0, stature=1.75, person="all")
    opened = posekit.open_views(path, source)
    wanted = "time image head_image confidence root lengths deviation derived unit stature"
    return [fields(one, "person") | fields(one.view, wanted) for one in opened]


@call
def errors(*paths: str) -> Any:
    """Say which error each wrong call raises; what it says is text, and is printed."""
    wrong: list[Callable[[], Any]] = [
        *(lambda path=path: posekit.read_view(path) for path in paths),
        lambda: posekit.builtin_view("seq9"),
        lambda: posekit.recover(posekit.builtin_view("seq1"), checks=("colision",)),
        lambda: posekit.recover(posekit.builtin_view("seq1"), ranges="tabel1"),
        lambda: posekit.recover(posekit.builtin_view("seq1"), group=-1.0),
        lambda: posekit.Validator("humna"),
        lambda: posekit.Validator().check(np.zeros((2, 13, 3))),
        lambda: posekit.load_figure("missing.urdf"),
        lambda: posekit.load_figure().scaled({"right_hip-right_kne": 0.4}),
        lambda: posekit.open_views(paths[0], posekit.Source(fov=400.0)),
    ]
    raised = []
    for one in wrong:
        try:
            one()
            raised.append("nothing")
        except posekit.PosekitError as error:
            raised.append(type(error).__name__)
            print(error)
    return raised


def main() -> None:
    """Run one call, and write what it returns."""
    name, *arguments = sys.argv[1:]
    Path("answer.json").write_text(json.dumps(plain(NAMED_CALLS[name](*arguments))))


if __name__ == "__main__":
    main()
