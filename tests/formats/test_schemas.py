"""The published schemas say what the readers accept."""

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posekit.batch.digests import of_values
from posekit.batch.recipe import Recipe
from posekit.batch.run_folder import Asked, Failure, run_folder
from posekit.body import load_figure
from posekit.errors import InputError
from posekit.evaluate import Evaluation, FrameSampling, Method, Sweep, by_path, evaluate, write_evaluation
from posekit.formats.own import (
    SCHEMA_NAMES,
    Family,
    LeeChenModel,
    ObjectFrame,
    ObjectResult,
    OpenCVModel,
    Result,
    ResultFrame,
    ScaledOrthographicModel,
    ValidationReport,
    View,
    read_nearer,
    schema,
    schema_text,
    write_configurations,
    write_object,
    write_postures,
    write_report,
    write_result,
    write_view,
)
from posekit.formats.own.batch_schema import BatchSettingsFields, ManifestFile, SourceFields
from posekit.settings import MEASURED_TOLERANCE, PartialTolerance, RecoverSettings
from posekit.skeleton import JOINTS, SEGMENT_NAMES
from posekit.synthesis import Capture
from posekit.views.source import Source

TOTALS = ("inputs", "shards", "done", "planned", "frames", "survivors", "empty")
KINDS = (
    "posekit.view/1",
    "posekit.result/1",
    "posekit.result/2",
    "posekit.postures/1",
    "posekit.report/1",
    "posekit.nearer/1",
    "posekit.object/1",
    "posekit.configurations/1",
    "posekit.evaluation/1",
    "posekit.batch/1",
    "posekit.batch_manifest/1",
)
EARLIER = Path(__file__).parent / "earlier"


@cache
def evaluation(**options: Any) -> Evaluation:
    """Evaluate two frames, seen through two cameras."""
    sampling = FrameSampling(frames_per_clip=2, consecutive="choose" in options)
    sweep = Sweep(yaws=(0.0, 90.0), heights=(1.5,))
    return evaluate(
        some_capture(), sampling=sampling, sweep=sweep, method=Method(noise=(0.0, 2.0), **options)
    )


def some_capture() -> Capture:
    """Return a person who stands still."""
    return Capture(
        points=np.tile(load_figure().neutral_points, (4, 1, 1)),
        clip=np.zeros(4, dtype=np.intp),
        names=("clip",),
        actions=("standing",),
        fps=np.array([25.0]),
        up=np.array([0.0, 0.0, 1.0]),
        source="capture",
    )


def write_batch(folder: Path) -> None:
    """Write what a run says of itself, with failures, beside the settings of another."""
    table, layout, camera = (folder.parent / name for name in ("ranges.toml", "layout.toml", "camera.toml"))
    table.write_text('schema = "posekit.ranges/1"\nkind = "configuration"\n')
    layout.write_text("x")
    camera.write_text("x")
    for name, recipe in (
        ("plain", Recipe()),
        (
            "rich",
            Recipe(
                source=Source(
                    skeleton=str(layout), camera=str(camera), size=(640, 480), rate=25.0, lengths=table
                ),
                settings=RecoverSettings(
                    ranges=str(table),
                    tolerance=PartialTolerance(rigid=0.01),
                    refine=True,
                    length_deviation=0.03,
                ),
            ),
        ),
        ("named", Recipe(source=Source(camera="nowhere.toml:left", calibrate=table))),
    ):
        settings = recipe.document()
        with run_folder(folder / name) as run:
            run.write_asked(
                Asked(hash=of_values(settings), settings=settings, inputs={"a": "0" * 64}, root=folder)
            )
            failures = [
                Failure(
                    shard=shard, input="a", person=of, start=of, stop=of, error="it", attempts=1, died=False
                )
                for shard, of in (("", None), ("a.parquet", 0))
            ]
            run.write_manifest(dict.fromkeys(TOTALS, 1), failures, {"a.parquet": "0" * 64})


def write_all(folder, rng) -> dict[str, list]:
    """Write a file or more of each schema and return what they hold."""
    cameras: list[Any] = [
        LeeChenModel(f=0.05),
        OpenCVModel(K=np.eye(3), R=np.eye(3)),
        ScaledOrthographicModel(scale=None),
    ]
    for index, camera in enumerate(cameras):
        view = View(
            camera=camera, time=np.zeros(2), image=rng.normal(size=(2, 14, 2)), lengths={"neck-pelvis": 0.5}
        )
        write_view(folder / f"view{index}.json", view, "cm")
    frame = ResultFrame(
        time=0.0,
        camera={"f": 1.0},
        levels={"joint": JOINTS, "physical": [1] * 14, "motion": [1] * 14},
        joints=rng.normal(size=(2, 14, 3)),
        q=rng.normal(size=(2, 3)),
        branches=["01", "10"],
        margins={"collision": np.array([np.nan, 1.0])},
        fk_distance=np.zeros(2),
        length_residual=np.zeros(2),
        rejected={"collision": 3},
    )
    write_result(
        folder / "result.json",
        Result(unit="m", configuration_names=["a", "b", "c"], settings={}, frames=[frame]),
    )
    joints = rng.normal(size=(2, 14, 3))
    joints[0, 1] = np.nan
    write_postures(folder / "postures.json", joints)
    write_report(folder / "report.json", ValidationReport(settings={}, postures=[]))
    rod = ObjectFrame(
        time=0.0,
        judged="exact",
        levels=(("a", 1), ("b", 2)),
        points=np.array([[[0, 0, 0], [0.3, 0, 0.4]]]),
        branches=("1",),
        flips=np.array([[1]], dtype=np.int8),
        scales=np.array([800.0]),
        margins={"closure": np.array([np.nan])},
        q=np.empty((1, 0)),
        fk_distance=np.array([np.nan]),
        certified=(None,),
        reasons=("",),
        rejected={"closure/a-b": 1},
        family=Family(how="min", bound=790.0, segment="a-b", chosen=np.array([800.0])),
    )
    thing = ObjectResult(
        linkage="rod",
        points=("a", "b"),
        segments=(("a", "b"),),
        lengths=np.array([0.5]),
        unit="m",
        configuration_names=(),
        settings={},
        frames=[rod],
    )
    write_object(folder / "object.json", thing)
    write_configurations(folder / "configurations.json", rng.normal(size=(2, 3)), ["a", "b", "c"])
    near = {"schema": "posekit.nearer/1", "frames": [{"neck-pelvis": "neck"}]}
    (folder / "nearer.json").write_text(json.dumps(near), encoding="utf-8")
    assert read_nearer(folder / "nearer.json") == [{"neck-pelvis": "neck"}]
    write_evaluation(folder / "evaluation.json", evaluation())
    write_evaluation(
        folder / "followed.json",
        evaluation(choose=by_path, settings=RecoverSettings(tolerance=MEASURED_TOLERANCE)),
    )
    write_batch(folder / "batch")
    documents: dict[str, list] = {name: [] for name in SCHEMA_NAMES}
    for path in (*folder.rglob("*.json"), *EARLIER.glob("*.json")):
        document = json.loads(path.read_text())
        documents[document["schema"]].append(document)
    return documents


def test_each_is_versioned_and_closed():
    assert SCHEMA_NAMES == tuple(KINDS)
    for name in SCHEMA_NAMES:
        found = schema(name)
        assert found["title"] == name
        assert found["$id"] == "urn:" + name.replace(".", ":").replace("/", ":")
        assert found["properties"]["schema"]["const"] == name
        assert found["additionalProperties"] is False
        assert {"schema", "unit"} & set(found["required"])
        assert json.loads(schema_text(name)) == found
        newest = max(other for other in SCHEMA_NAMES if other.partition("/")[0] == name.partition("/")[0])
        assert schema(name.removeprefix("posekit.").partition("/")[0]) == schema(newest)


def test_the_names_of_joints_and_segments_are_published():
    definitions = schema("view")["$defs"]
    assert definitions["FrameFields"]["properties"]["image"]["propertyNames"]["enum"] == list(JOINTS)
    lengths = definitions["FigureFields"]["properties"]["lengths"]["anyOf"][0]
    assert lengths["propertyNames"]["enum"] == list(SEGMENT_NAMES)


def test_what_is_written_is_valid_for_another_validator(tmp_path, rng):
    jsonschema = pytest.importorskip("jsonschema")
    for name, documents in write_all(tmp_path, rng).items():
        jsonschema.Draft202012Validator.check_schema(schema(name))
        validator = jsonschema.Draft202012Validator(schema(name))
        assert documents
        for document in documents:
            validator.validate(document)
            assert not validator.is_valid(document | {"more": 1})


def test_what_is_refused_is_invalid_for_another_validator(tmp_path, rng):
    jsonschema = pytest.importorskip("jsonschema")
    documents = write_all(tmp_path, rng)["posekit.view/1"]
    document = next(found for found in documents if found["camera"]["model"] == "lee-chen")
    validator = jsonschema.Draft202012Validator(schema("view"))
    assert not validator.is_valid(document | {"camera": {"model": "lee-chen", "f": 0}})
    assert not validator.is_valid(document | {"frames": []})
    assert not validator.is_valid(document | {"frames": [{"time": 0, "image": {"pelvis": [1, 2]}}]})
    some = [{"time": 0, "image": {"pelvis": [1, 2]}}, {"time": 1, "image": {"neck": [1, 2]}}]
    assert validator.is_valid(document | {"frames": some})
    assert not validator.is_valid(
        document | {"frames": [{"time": 0, "image": {"neck": [1, 2], "x": [1, 2]}}]}
    )


def test_an_unknown_schema_is_refused():
    with pytest.raises(InputError, match=r'schema: got "views"; .*did you mean view'):
        schema("views")


def test_all_that_decides_a_batch_is_in_its_schema():
    settings = Recipe().document()
    assert list(settings) == list(BatchSettingsFields.model_fields)
    assert list(settings["source"]) == list(SourceFields.model_fields)
    assert set(TOTALS) | {"schema_", "failed", "digests"} == set(ManifestFile.model_fields)


def test_numbers_that_an_evaluation_cannot_have_are_refused(tmp_path):
    jsonschema = pytest.importorskip("jsonschema")
    write_evaluation(tmp_path / "evaluation.json", evaluation())
    document = json.loads((tmp_path / "evaluation.json").read_text())
    validator = jsonschema.Draft202012Validator(schema("evaluation"))
    validator.validate(document)
    assert {"action", "yaw", "height", "noise"} <= set(document["conditions"][0])
    everything = document["all"]
    for wrong in (
        {"retained_branch": 1.1},
        {"frames": 0},
        {"survivors": {"mean": 1.0}},
        {"limbs_right": {"worst": 1.0}},
        {"noise": 0.0},
    ):
        assert not validator.is_valid(document | {"all": everything | wrong}), wrong
    without = {name: value for name, value in document["by_yaw"][0].items() if name != "yaw"}
    assert not validator.is_valid(document | {"by_yaw": [without]})


def test_a_batch_note_names_contents_by_their_hash(tmp_path):
    jsonschema = pytest.importorskip("jsonschema")
    write_batch(tmp_path / "batch")
    validator = jsonschema.Draft202012Validator(schema("batch"))
    document = json.loads((tmp_path / "batch" / "rich" / "batch.json").read_text())
    validator.validate(document)
    assert not validator.is_valid(document | {"inputs": {"a": "0" * 63}})
    assert not validator.is_valid(document | {"settings": document["settings"] | {"ranges": []}})
    source = document["settings"]["source"] | {"camera": ["only one"]}
    assert not validator.is_valid(document | {"settings": document["settings"] | {"source": source}})
