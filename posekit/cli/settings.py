"""`posekit settings`: list all settings of a command with defaults and units."""

from __future__ import annotations

from dataclasses import fields

import click

from posekit.cli.command import command, descriptions, say
from posekit.settings import RecoverSettings, ValidateSettings

KINDS = {"recover": RecoverSettings, "validate": ValidateSettings}


@command("settings", "posekit settings recover", "posekit recover walk.json -o out.json --set coverage=1")
@click.argument("name", metavar="COMMAND", type=click.Choice(list(KINDS)))
def settings(name: str) -> None:
    """List the settings for --set and --settings FILE.toml, in TOML format."""
    kind = KINDS[name]
    described = descriptions(kind)
    for one in fields(kind):
        say(f"# {described.get(one.name, '')}")
        say(f"{'# ' if one.default is None else ''}{one.name} = {_toml(one.default)}\n")


def _toml(value: object) -> str:
    """Write a default value as TOML; a default that depends on the input is written as …."""
    if value is None:
        return "…"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return f"[{', '.join(map(_toml, value))}]"
    return f'"{value}"' if isinstance(value, str) else str(value)
