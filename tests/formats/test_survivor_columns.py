"""The one table of a survivor's columns: what is in files follows from it, and a new column is one row of it."""

import json
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from posekit.batch.columns import BATCH_COLUMNS, value_columns
from posekit.batch.recipe import Recipe
from posekit.body import load_figure
from posekit.formats.own import ResultFrame, schema, write_result
from posekit.formats.own.column import Column, column, columns_in
from posekit.formats.own.digits import Precision
from posekit.formats.own.frame_answer import FrameAnswer
from posekit.formats.own.inferred import Inferred
from posekit.formats.own.npz import write_npz
from posekit.formats.own.posture_set import PostureSet
from posekit.formats.own.survivor_columns import SURVIVOR_COLUMNS, Likelihoods, SurvivorColumns
from posekit.formats.own.survivor_json import survivor_columns, survivor_rows
from posekit.formats.own.survivor_models import annotation_of, model_of, table_model_of
from posekit.formats.own.survivor_npz import survivor_arrays, survivors_in
from posekit.formats.own.units import Unit
from posekit.geometry import Array
from posekit.recovery import recover, result_of
from posekit.safe_io.npz_file import open_npz
from posekit.synthesis import random_views
from posekit.views.builtin import view_of

NQ, COUNT = 5, 3
TABLES = (SurvivorColumns, Likelihoods, FrameAnswer, Inferred, PostureSet)
EXTENTS = {"q": NQ, "margins": ["collision"]}


@dataclass(frozen=True, kw_only=True, eq=False)
class WiderColumns(SurvivorColumns):
    """A table with one row more."""

    schema_title: ClassVar = ("Wider", "One survivor, and how far its wrists are apart.")

    reach: Array = column("From wrist to wrist, in `unit`.", length_power=1, null="number", batch_place=8)


def some(table: type[SurvivorColumns] = SurvivorColumns, **more: Any) -> Any:
    rng = np.random.default_rng(1)
    return table(
        joints=rng.normal(size=(COUNT, 14, 3)),
        q=rng.normal(size=(COUNT, NQ)),
        branches=["01" * 6 + "0"] * COUNT,
        margins={"collision": np.array([0.5, np.nan, -1.0])},
        fk_distance=np.zeros(COUNT),
        length_residual=np.array([0.0, 0.01, np.nan]),
        **more,
    )


def test_the_schema_has_the_columns_with_their_meanings() -> None:
    posture = schema("result")["$defs"]["ResultPosture"]
    assert list(posture["properties"]) == [found.key for found in SURVIVOR_COLUMNS.values()]
    for found in SURVIVOR_COLUMNS.values():
        assert posture["properties"][found.key]["description"] == found.meaning
    assert set(posture["required"]) == {
        found.key for found in SURVIVOR_COLUMNS.values() if not (found.optional or found.detail)
    }
    earlier = schema("posekit.result/1")["$defs"]["ResultPosture"]
    assert set(earlier["required"]) == {
        found.key for found in SURVIVOR_COLUMNS.values() if not found.optional
    }
    refined = schema("result")["$defs"]["ResultRefined"]["properties"]
    assert list(refined) == list(columns_in(Likelihoods))


def test_a_results_files_hold_the_columns(tmp_path: Path) -> None:
    recovery = recover(view_of(random_views(load_figure(), 2, np.random.default_rng(3))), group=0.05)
    result = result_of(recovery)
    write_result(tmp_path / "a.json", result)
    write_result(tmp_path / "a.npz", result)
    known = [name for name in SURVIVOR_COLUMNS if getattr(result.frames[0], name) is not None]
    posture = json.loads((tmp_path / "a.json").read_text())["frames"][0]["postures"][0]
    assert list(posture) == [SURVIVOR_COLUMNS[name].key for name in known]
    with open_npz(tmp_path / "a.npz") as archive:
        assert {name.partition("/")[0] for name in archive.names} >= set(known)
    assert set(SURVIVOR_COLUMNS) < set(ResultFrame.__dataclass_fields__)


def test_a_batch_holds_what_the_table_gives_it_in_its_order() -> None:
    assert [found.batch_place for found in BATCH_COLUMNS] == sorted(
        {found.batch_place for found in BATCH_COLUMNS}
    )
    plain = value_columns(Recipe())
    assert plain == ("probability", "scale", "length_residual", "chi2")
    every = value_columns(Recipe(q=True, margins=True))
    assert every[: len(plain)] == plain
    assert {"margin.collision", "fk_distance", "q.x"} <= set(every)
    assert value_columns(Recipe(rank=False)) == plain[1:]


@pytest.mark.parametrize("unit", ["m", "cm", "mm"])
def test_a_row_more_is_a_column_more_in_json(unit: Any) -> None:
    wider = some(WiderColumns, reach=np.array([1.5, np.nan, 0.25]))
    rows = survivor_rows(wider, unit)
    assert [row["reach"] for row in rows][1] is None
    model: Any = model_of(WiderColumns)
    assert (
        model.model_json_schema()["properties"]["reach"]["description"] == "From wrist to wrist, in `unit`."
    )
    read = [model.model_validate(row) for row in rows]
    back = WiderColumns(**survivor_columns(WiderColumns, read, unit, extents=EXTENTS, carried=frozenset()))
    np.testing.assert_allclose(back.reach, wider.reach, rtol=1e-15)
    np.testing.assert_allclose(back.joints, wider.joints, rtol=1e-15)
    assert back.branches == wider.branches and back.groups is None
    with pytest.raises(ValueError, match="reach"):
        model.model_validate({key: value for key, value in rows[0].items() if key != "reach"})


@pytest.mark.parametrize("unit", ["m", "cm", "mm"])
def test_a_row_more_is_an_array_more_in_npz(tmp_path: Path, unit: Any) -> None:
    wider = some(WiderColumns, reach=np.array([1.5, np.nan, 0.25]))
    with (tmp_path / "a.npz").open("wb") as file:
        write_npz(file, survivor_arrays(WiderColumns, [wider], unit, carried=frozenset()))
    with open_npz(tmp_path / "a.npz") as archive:
        found = survivors_in(archive, WiderColumns, np.array([COUNT]), unit, extents=EXTENTS)
    assert "reach" in found and found["groups"] is None
    of_frame: dict[str, Any] = {name: None if rows is None else rows[0] for name, rows in found.items()}
    back = WiderColumns(**of_frame)
    np.testing.assert_allclose(back.reach, wider.reach, rtol=1e-15)
    np.testing.assert_allclose(back.margins["collision"], wider.margins["collision"], rtol=1e-15)


@pytest.mark.parametrize("unit", ["m", "mm"])
@pytest.mark.parametrize("precision", [None, Precision(decimals=4), Precision(decimals=4, binary=True)])
def test_a_covariance_in_a_file_stays_one(precision: Precision | None, unit: Unit) -> None:
    covariance = columns_in(Likelihoods)["covariance"]
    rng = np.random.default_rng(2)
    ray = rng.normal(size=(300, 14, 3))
    across, along = 10.0 ** rng.uniform(-4, -2, (300, 14, 1, 1)), 10.0 ** rng.uniform(-2, 0, (300, 14, 1, 1))
    ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
    known = across**2 * np.eye(3) + along**2 * ray[..., :, None] * ray[..., None, :]
    read = covariance.in_memory(covariance.in_file(known, unit, precision), unit)
    of_known = np.linalg.solve(known, read) - np.eye(3)
    assert np.abs(np.linalg.eigvals(of_known)).max() < 0.2
    again = covariance.in_file(read, unit, precision)
    np.testing.assert_array_equal(again, covariance.in_file(known, unit, precision))
    assert not covariance.in_file(0.0 * known, unit, precision).any()


@pytest.mark.parametrize("whole", [False, True])
@pytest.mark.parametrize("table", [WiderColumns, *TABLES], ids=lambda table: table.__name__)
def test_a_field_says_what_its_column_means_and_only_details_may_be_left_out(table: Any, whole: bool) -> None:
    model = model_of.__wrapped__(table, whole=whole)
    assert (model.__name__, model.__doc__) == table.schema_title
    for each in columns_in(table).values():
        field = model.model_fields[each.key]
        assert field.description == each.meaning
        assert field.is_required() != (each.optional or (each.detail and not whole))
        assert field.is_required() or field.default is None
    whole_table = table_model_of.__wrapped__(table)
    assert {key: field.description for key, field in whole_table.model_fields.items()} == {
        each.key: each.meaning for each in columns_in(table).values()
    }


NUMBERS = [
    each
    for table in TABLES
    for each in columns_in(table).values()
    if each.kind in ("float", "int") and not each.by_check
]


def nested(shape: Sequence[int], leaf: object) -> object:
    return [nested(shape[1:], leaf) for _ in range(shape[0])] if shape else leaf


@pytest.mark.parametrize("each", NUMBERS, ids=lambda each: each.key)
def test_numbers_have_their_columns_extents_and_nothing_stands_where_it_says(each: Column) -> None:
    kind = TypeAdapter(annotation_of(each))
    shape, number = [extent or 2 for extent in each.shape], each.lower or 0
    kind.validate_python(nested(shape, number))
    places = {"number": len(shape), "row": len(shape) - 1}
    for depth in range(len(shape) + 1):
        with_nothing = nested(shape[:depth], None)
        if places.get(each.null or "") == depth:
            kind.validate_python(with_nothing)
        else:
            with pytest.raises(ValidationError):
                kind.validate_python(with_nothing)
    for depth, extent in enumerate(each.shape):
        more = [*shape[:depth], shape[depth] + 1, *shape[depth + 1 :]]
        with nullcontext() if extent is None else pytest.raises(ValidationError):
            kind.validate_python(nested(more, number))
