"""Validate what a file holds against its pydantic model, and word the first error as one line."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, ClassVar, Final, NoReturn, TypeVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, ValidationError, model_validator
from pydantic_core import ErrorDetails, PydanticCustomError

from posekit.errors import InputError, PosekitError
from posekit.safe_io.refusal import cut, nearest, refusal, shown

Model = TypeVar("Model", bound="FileModel")

MAX_FIELDS: Final = 1000
"""How many entries an object of a schema may have: an error is kept for each that is wrong."""

_OWN = "posekit"
_REMEDIES: Final = {
    "missing": "add it",
    "extra_forbidden": "remove it",
    "too_short": "add what is missing",
    "too_long": "remove what is too much",
    "literal_error": "write one of these",
}


class FileModel(BaseModel):
    """What all files have in common: no unknown fields, no conversions, finite numbers.

    Attributes
    ----------
    hints : mapping of str to str
        What to do about a wrong value, by the name of the field that it is in, however deep.
    hints_at : mapping of str to str
        The same, by the name of the field that is wrong itself.
    tags : frozenset of str
        Names of variants, which pydantic puts into an error's location though the file does not nest there.
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)
    hints: ClassVar[Mapping[str, str]] = {}
    hints_at: ClassVar[Mapping[str, str]] = {}
    tags: ClassVar[frozenset[str]] = frozenset()

    @model_validator(mode="before")
    @classmethod
    def _few_fields(cls, value: Any) -> Any:
        return _few(value)


def refuse(expected: str, remedy: str, *, at: str = "", got: str = "") -> NoReturn:
    """Refuse a value from inside a validator.

    Parameters
    ----------
    expected, remedy : str
        See `posekit.safe_io.refusal.refusal`.
    at : str
        Where inside the validated value, ``"neck"``; the value itself when empty.
    got : str
        What was found; the validated value when empty.
    """
    context = {"expected": expected, "remedy": remedy, "at": at, "got": got}
    raise PydanticCustomError(_OWN, "{expected}", context)


def named(names: tuple[str, ...], kind: str) -> BeforeValidator:
    """Annotate an object whose keys are to be among some names; the nearest ones are in the error."""
    valid = frozenset(names)

    def check(value: Any) -> Any:
        if isinstance(value, dict):
            for name in value:
                if name not in valid:
                    refuse(f"the name of a {kind}", nearest(name, names), at=cut(name), got=shown(name))
        return value

    return BeforeValidator(check)


def _few(value: Any) -> Any:
    if isinstance(value, dict) and len(value) > MAX_FIELDS:
        refuse(f"at most {MAX_FIELDS} entries", "remove what does not belong there")
    return value


FEW_ENTRIES: Final = BeforeValidator(_few)
"""Annotate an object with free keys: not more of them than anyone needs."""


def checked(check: Callable[[Any], object], expected: str) -> AfterValidator:
    """Annotate a value that a check of posekit is to accept; its error becomes the field's."""

    def validate(value: Any) -> Any:
        try:
            check(value)
        except PosekitError as error:
            refuse(f"{expected} ({error})", "correct it")
        return value

    return AfterValidator(validate)


def validated(model: type[Model], document: object, path: str | Path) -> Model:
    """Validate a parsed document.

    Raises
    ------
    InputError
        For the first error, with how many more there are.
    """
    expected = str(model.model_fields["schema_"].annotation.__args__[0])  # type: ignore[union-attr]
    _check_schema(document, expected, path)
    return conforming(model, document, path)


def conforming(model: type[Model], document: object, path: str | Path) -> Model:
    """Validate what names no schema: a part of a document, or a line of a stream. See `validated`."""
    try:
        return model.model_validate(document)
    except ValidationError as error:
        raise _worded(model, error, path) from None


def _check_schema(document: object, expected: str, path: str | Path) -> None:
    """Refuse a document of another kind or version before its fields are looked at."""
    if not isinstance(document, dict):
        raise refusal(path, "", shown(document), f"an object of schema {expected}", "see docs: files")
    schema = document.get("schema")
    if schema == expected:
        return
    got = shown(schema) if "schema" in document else "nothing"
    kind = expected.rpartition("/")[0]
    if isinstance(schema, str) and schema.startswith(f"{kind}/"):
        remedy = "the file is of another version: write it again with this one"
    elif isinstance(schema, str) and schema.startswith("posekit."):
        remedy = f"give a file of schema {expected} instead"
    else:
        remedy = (
            f'write schema = "{expected}" in the first line'
            if Path(path).suffix.lower() != ".json"
            else f'add "schema": "{expected}" if it is such a file'
        )
    raise refusal(path, "schema", got, f'"{expected}"', remedy)


def _worded(model: type[FileModel], error: ValidationError, path: str | Path) -> InputError:
    first = error.errors(include_url=False)[0]
    field, got, expected, remedy = _wording(model, first)
    more = error.error_count() - 1
    if more:
        remedy += f" (and {more} more error{'s' if more > 1 else ''} at least)"
    return refusal(path, field, got, expected, remedy)


def _wording(model: type[FileModel], error: ErrorDetails) -> tuple[str, str, str, str]:
    kind, context = error["type"], error.get("ctx", {})
    field = _field(error["loc"], model.tags)
    got = "nothing" if kind == "missing" else shown(error["input"])
    names = [str(name) for name in reversed(error["loc"])]
    hints = [model.hints_at[name] for name in names[:1] if name in model.hints_at]
    hints += [model.hints[name] for name in names if name in model.hints]
    remedy = (hints or [_REMEDIES.get(kind, "correct it")])[0]
    expected = _plain(error)
    if kind == _OWN:
        inside = context["at"]
        field += inside if inside.startswith("[") or not field or not inside else f".{inside}"
        return field, context["got"] or got, context["expected"], context["remedy"]
    if kind == "extra_forbidden":
        known = set(_fields(model.model_json_schema())) - {names[0]}
        suggestion = nearest(names[0], sorted(known))
        expected = "no field of this name"
        remedy = f"{suggestion} Otherwise remove it" if suggestion.startswith("did") else "remove it"
    elif kind in ("missing", "union_tag_not_found"):
        got, expected, remedy = "nothing", "this field", (hints or ["add it"])[0]
    elif kind == "too_short":
        expected = f"at least {context['min_length']} entries"
    elif kind == "too_long":
        expected = f"at most {context['max_length']} entries"
    elif kind == "literal_error":
        expected = context["expected"]
    elif kind == "union_tag_invalid":
        got, expected, remedy = (
            shown(context["tag"]),
            f"one of {context['expected_tags']}",
            "write one of these",
        )
    if kind.startswith("union_tag"):
        field += "." + context["discriminator"].strip("'")
    return field, got, expected, remedy


def _field(location: tuple[int | str, ...], tags: frozenset[str]) -> str:
    """Spell pydantic's location as ``frames[3].image.left_elbow``."""
    text = ""
    for part in location:
        if isinstance(part, int):
            text += f"[{part}]"
        elif part not in tags and part != "[key]":
            text += f".{cut(part)}" if text else cut(part)
    return text


def _plain(error: ErrorDetails) -> str:
    """Word what was expected, without pydantic's own terms."""
    words = {
        "float_type": "a number",
        "int_type": "a whole number",
        "finite_number": "a finite number",
        "string_type": "a text",
        "list_type": "a list",
        "dict_type": "an object",
        "model_type": "an object",
        "model_attributes_type": "an object",
        "bool_type": "true or false",
    }
    context = error.get("ctx", {})
    if error["type"] in words:
        return words[error["type"]]
    if error["type"] == "greater_than":
        return f"a number greater than {context['gt']:g}"
    if error["type"] == "less_than_equal":
        return f"a number of at most {context['le']:g}"
    if error["type"] == "greater_than_equal":
        return f"a number of at least {context['ge']:g}"
    return error["msg"].removeprefix("Input should be ")


def _fields(schema: object) -> Iterator[str]:
    """Yield the names of all fields in a JSON Schema."""
    if isinstance(schema, dict):
        for key, value in schema.items():
            if key == "properties":
                yield from value
            yield from _fields(value)
    elif isinstance(schema, list):
        for value in schema:
            yield from _fields(value)
