"""One check by name and parameters, so that a worker process or a later reader can make it again."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from posekit.errors import InputError


@dataclass(frozen=True, kw_only=True)
class CheckSettings:
    """A check as settings and files record it.

    Parameters
    ----------
    name : str
        The name under which the check registers itself, as ``joint-range``.
    parameters : mapping of str to JSON value
        What the check is made with, where that is not what it is made with by default.

    Examples
    --------
    >>> CheckSettings(name="collision", parameters={"contact_margin": -0.02}).to_json()
    {'name': 'collision', 'parameters': {'contact_margin': -0.02}}
    """

    name: str
    parameters: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        # Parameters go through a JSON text once: what cannot be recorded is refused here rather than in a worker.
        try:
            parameters = json.loads(json.dumps(dict(self.parameters), allow_nan=False))
        except (TypeError, ValueError) as error:
            raise InputError(
                f"the check {self.name}: its parameters cannot be written as JSON ({error}); expected finite numbers, "
                "strings, true, false, null, and lists and objects of these"
            ) from None
        object.__setattr__(self, "parameters", parameters)

    def __hash__(self) -> int:
        return hash((self.name, json.dumps(self.parameters, sort_keys=True)))

    def __str__(self) -> str:
        """Name the check, with its parameters where it has some: ``collision {"contact_margin": -0.02}``."""
        return f"{self.name} {json.dumps(self.parameters, sort_keys=True)}" if self.parameters else self.name

    def to_json(self) -> dict[str, Any]:
        """Return the check as a JSON object with ``name`` and ``parameters``."""
        return {"name": self.name, "parameters": dict(self.parameters)}

    @staticmethod
    def from_json(value: str | Mapping[str, Any]) -> CheckSettings:
        """Read a check from what a file says: its name alone, or an object with ``name`` and ``parameters``."""
        if isinstance(value, str):
            return CheckSettings(name=value)
        if not isinstance(value.get("name"), str) or not isinstance(value.get("parameters", {}), Mapping):
            raise InputError(
                f"{value!r} is no check; expected its name, or an object with name and parameters"
            )
        return CheckSettings(name=value["name"], parameters=value.get("parameters", {}))


def check_settings(given: Any) -> CheckSettings:
    """Record a check that is given by its name, by its settings, as JSON, or as the check itself.

    Raises
    ------
    InputError
        Where it is none of these.
    """
    if isinstance(given, CheckSettings):
        return given
    if isinstance(given, str | Mapping):
        return CheckSettings.from_json(given)
    own = getattr(given, "settings", None)
    if isinstance(own, CheckSettings):
        return own
    raise InputError(
        f"--checks: {given!r} is no check; expected a name, CheckSettings, or a registered check"
    )
