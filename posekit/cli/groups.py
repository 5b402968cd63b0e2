"""Groups of options: what several commands take is one parameter of each, a dataclass with a field an option."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, is_dataclass
from functools import partial, wraps
from inspect import Parameter, signature
from typing import Any, get_type_hints


def with_groups(command: Callable[..., None]) -> Callable[..., Callable[[], None]]:
    """Give a command an option for every field of the groups that it takes.

    A parameter whose type is a dataclass is a group: its fields are annotated as parameters of a command are, each with
    its default, and stand in the help where the group stands in the command. What reads the command line gets back the
    call of the command with the groups made of them, which is then made.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> @dataclass(frozen=True, kw_only=True)
    ... class Size:
    ...     width: int = 1
    ...     height: int = 2
    >>> @with_groups
    ... def draw(*, name: str, size: Size, frame: bool = False) -> None:
    ...     print(name, size)
    >>> draw(name="a", width=5, height=2, frame=True)()
    a Size(width=5, height=2)
    """
    hints = get_type_hints(command, include_extras=True)
    groups: dict[str, type] = {}
    options: list[Parameter] = []
    for name, parameter in signature(command).parameters.items():
        hint = hints[name]
        if not is_dataclass(hint):
            options.append(parameter.replace(annotation=hint, kind=Parameter.KEYWORD_ONLY))
            continue
        groups[name] = hint  # type: ignore[assignment]
        own = get_type_hints(hint, include_extras=True)
        options += [
            Parameter(one.name, Parameter.KEYWORD_ONLY, default=one.default, annotation=own[one.name])
            for one in fields(hint)
        ]

    @wraps(command)
    def call(**given: Any) -> Callable[[], None]:
        made = {
            name: group(**{one.name: given.pop(one.name) for one in fields(group)})
            for name, group in groups.items()
        }
        return partial(command, **given, **made)

    # What typer looks at: the options in their places, instead of the groups.
    call.__signature__ = signature(command).replace(parameters=options)  # type: ignore[attr-defined]
    call.__annotations__ = {option.name: option.annotation for option in options}
    return call
