"""Tables that come with the package."""

from __future__ import annotations

from importlib import resources
from typing import Any

from posekit.safe_io.toml_file import parse_toml


def built_in_document(folder: str, name: str) -> dict[str, Any]:
    """Parse ``<name>.toml`` in a folder of `posekit.urdf`: ``ranges``, ``priors``, ``joint_maps``, and others."""
    text = (resources.files("posekit.urdf") / folder / f"{name}.toml").read_text(encoding="utf-8")
    return parse_toml(text, name)
