"""Laws over everything that users hold: it is frozen, made by name, printed in one line, and read-only."""

from __future__ import annotations

import dataclasses
import importlib
import pkgutil
from collections.abc import Iterator
from typing import Any

import numpy as np

import posekit
from posekit.geometry import Record


def modules() -> Iterator[Any]:
    """Import every module of the package."""
    for one in pkgutil.walk_packages(posekit.__path__, "posekit."):
        if not one.name.endswith("__main__"):
            yield importlib.import_module(one.name)


def dataclasses_of_posekit() -> set[Any]:
    """Return every dataclass of the package."""
    kinds = {kind for module in modules() for kind in vars(module).values() if isinstance(kind, type)}
    return {
        kind for kind in kinds if dataclasses.is_dataclass(kind) and kind.__module__.startswith("posekit")
    }


def test_what_users_hold_is_frozen_and_made_by_name() -> None:
    kinds = dataclasses_of_posekit()
    assert len(kinds) > 40
    by_place = {"Judgement", "FunctionCheck"}  # authors of checks write them
    for kind in kinds:
        made, fields = kind.__dataclass_params__, dataclasses.fields(kind)
        assert made.frozen, kind
        assert kind.__name__ in by_place or all(one.kw_only for one in fields), kind
        assert not (issubclass(kind, Record) and made.repr), kind
        if any("Array" in str(one.type) for one in fields):
            assert not made.eq, kind  # arrays have no single truth value


def test_arrays_that_users_hold_are_read_only() -> None:
    view = posekit.builtin_view("seq1")
    found = posekit.recover(view)
    motion = found.motion()
    held = (view, view.camera, found.survivors, found.answer, found.frames, motion)
    for one in held:
        for field in dataclasses.fields(one):
            value = getattr(one, field.name)
            assert not isinstance(value, np.ndarray) or not value.flags.writeable, (type(one), field.name)


def test_what_users_hold_is_printed_in_one_line() -> None:
    found = posekit.recover(posekit.builtin_view("seq1"))
    for one in (found, found[0], found.survivors, posekit.load_figure(), posekit.Validator()):
        assert "\n" not in repr(one) and len(repr(one)) < 300
    assert f"joints=({len(found.survivors)}, 14, 3)" in repr(found.survivors)


def test_findings_name_the_row_of_a_batch_of_postures() -> None:
    joints = np.repeat(posekit.load_figure().neutral_points[None, :14], 5, axis=0).copy()
    joints[3, 8, 2] += 0.3
    g1 = posekit.Validator("g1")
    q = np.tile(g1.robot.neutral, (5, 1))
    q[3, -1] = 9.0
    for report in (posekit.validate(joints), posekit.Validator().check(joints), g1.check(q)):
        assert set(report.table()["frame"]) == {3} == set(np.flatnonzero(~report.ok))
        assert "frame 3" in report.summary()
