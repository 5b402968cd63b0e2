"""Shared code of the commands: options made from settings, groups of options in the help, error messages."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, Final

import click

from posekit.errors import InputError, nearest, one_line, refusal, shown
from posekit.settings import Settings, stated

#: Parameters with the path of an output.
OUTPUTS: Final = frozenset({"output", "keep", "repair"})

#: Names of the option for a layout.
LAYOUT: Final = ("--layout", "--skeleton", "--format")


def say(text: str, *, err: bool = False) -> None:
    """Print text without control characters, because names in files may contain escape sequences and line breaks."""
    click.echo("\n".join(one_line(line) for line in text.split("\n")), err=err)


class Command(click.Command):
    """A command whose help lists options in groups (panels), and which suggests names for unknown options."""

    def __init__(self, *args: Any, examples: Sequence[str] = (), **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.examples = examples

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the arguments; raise an error for an unknown option, and for an output that is also an input."""
        try:
            rest = super().parse_args(ctx, args)
        except click.NoSuchOption as error:
            known = [name[2:] for option in self.params for name in option.opts if name.startswith("--")]
            otherwise = f"see posekit {self.name} --help"
            hint = nearest(error.option_name.lstrip("-"), known, otherwise, mark="--")
            raise refusal(
                "", error.option_name, "an unknown option", f"an option of {self.name}", hint
            ) from None
        _refuse_overwriting(ctx.params)
        return rest

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options into the help, one group after another."""
        panels: dict[str, list[tuple[str, str]]] = {}
        for parameter in self.params:
            record = parameter.get_help_record(ctx)
            if isinstance(parameter, click.Option) and record is not None:
                panels.setdefault(getattr(parameter, "panel", "Options"), []).append(record)
        for title, records in panels.items():
            with formatter.section(title):
                formatter.write_dl(records)

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the example command lines at the end of the help."""
        if self.examples:
            with formatter.section("Examples"):
                formatter.write("".join(f"  {line}\n" for line in self.examples))


class Option(click.Option):
    """An option with the title of its group (panel) in the help."""

    def __init__(self, *args: Any, panel: str = "Options", **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.panel = panel


def command(name: str, *examples: str) -> Callable[[Callable[..., Any]], click.Command]:
    """Return a decorator that makes a function the command `name`, with examples at the end of its help."""
    return click.command(name, cls=Command, examples=examples)


def option(*names: str, panel: str = "Options", **kwargs: Any) -> Callable[[Any], Any]:
    """Declare an option in a group (panel) of the help; the help states its default, except for switches."""
    default = kwargs.get("default")
    shown_default = default not in (None, "") and not isinstance(default, bool)
    return click.option(*names, cls=Option, panel=panel, **{"show_default": shown_default, **kwargs})


def output(
    metavar: str, help: str, *, required: bool = True
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Declare ``-o``."""
    return option(
        "-o", "--output", metavar=metavar, help=help, required=required, type=click.Path(path_type=Path)
    )


def apply(*decorators: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Combine decorators that declare options; the help lists the options in the given order."""

    def joined(function: Any) -> Any:
        for one in reversed(decorators):
            function = one(function)
        return function

    return joined


def seeing() -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Declare the options that describe key points: camera, person, layout and rate."""
    calibration = "Calibration of the camera. Default: the camera is unknown."
    return apply(
        option("--camera", default=None, metavar="FILE[:NAME]", help=calibration),
        option("--person", default="", metavar="WHO", help="largest, surest, first or a track's number."),
        option(*LAYOUT, default="", metavar="NAME|FILE.toml", help="Names of the key points."),
        option("--rate", "--fps", default=None, metavar="HZ", help="Frames per second."),
    )


#: Options that control how a file is read: names, default, metavar, help.
READING: Final = (
    (LAYOUT, "", "NAME|FILE.toml", "Names of the file's joints or columns. Default: recognised."),
    (("--unit",), None, "m|cm|mm|in", "Unit of length. Default: the file's."),
    (("--up",), None, "AXIS", "Axis that points up, as +z. Default: detected."),
    (("--rate", "--fps"), None, "HZ", "Frames per second if the file has no times."),
    (("--urdf",), "", "NAME|FILE", "Robot whose configurations the file contains."),
)


def reading(*, urdf: bool = True) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Declare the options that control how a file is read."""
    rows = READING if urdf else READING[:-1]
    return apply(
        *(
            option(*names, default=default, metavar=metavar, help=text, panel="Reading")
            for names, default, metavar, text in rows
        )
    )


def settings_options(
    kind: type[Settings], shown_in_help: Mapping[str, str], panel: str = "Settings"
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Declare an option for every field of a class of settings.

    Parameters
    ----------
    kind : type of Settings
        Class of settings.
    shown_in_help : mapping of str to str
        Fields that the help lists, with their metavars. Fields that are not listed are options, too; `posekit settings`
        lists them.
    panel : str
        Panel of the help.
    """
    described = descriptions(kind)
    made: list[Callable[[Any], Any]] = []
    names = [*shown_in_help, *(one.name for one in fields(kind) if one.name not in shown_in_help)]
    for name in names:
        flag = "--" + name.replace("_", "-")
        hidden = name not in shown_in_help
        default = next(one.default for one in fields(kind) if one.name == name)
        switch = isinstance(default, bool) or name == "refine"
        made.append(
            option(
                f"{flag}/--no-{flag[2:]}" if switch else flag,
                name,
                default=None,
                metavar=None if switch else shown_in_help.get(name, "VALUE"),
                panel=panel,
                hidden=hidden,
                help=described.get(name, ""),
            )
        )
    made += [
        option(
            "--settings", "settings_file", panel=panel, metavar="FILE.toml", help="Read settings from a file."
        ),
        option(
            "--set",
            "set_fields",
            multiple=True,
            panel=panel,
            metavar="FIELD=VALUE",
            help=f"Any other setting; see `posekit settings {kind.__name__.removesuffix('Settings').lower()}`.",
        ),
    ]
    return apply(*made)


def descriptions(kind: type[Settings]) -> dict[str, str]:
    """Return the description of each field from the docstrings of a class of settings and its base classes."""
    found: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        name = ""
        for line in (base.__doc__ or "").split("\n"):
            if line.startswith("    ") and " : " in line and not line.startswith("        "):
                name = line.strip().partition(" : ")[0]
                found[name] = ""
            elif line.startswith("        ") and name:
                found[name] = f"{found[name]} {line.strip()}".strip()
    return {one: text.replace("``", "") for one, text in found.items()}


def settings_from(kind: type[Settings], given: dict[str, Any]) -> Any:
    """Build the settings from a command's options, and remove these options from `given`.

    Values from ``--set`` override the settings file, and options override both.
    """
    names = [one.name for one in fields(kind)]
    options = {name: given.pop(name) for name in names if name in given}
    path, pairs = given.pop("settings_file", None), given.pop("set_fields", ())
    record = kind.from_toml(path) if path else kind()
    for pair in pairs:
        name, equals, text = pair.partition("=")
        if not equals:
            raise refusal("", "--set", shown(pair), "FIELD=VALUE", "write it as --set coverage=1")
        record = record.changed(**{name.strip().replace("-", "_"): _value(text.strip())})
    try:
        return record.changed(**stated(**options))
    except InputError as error:
        name, colon, rest = str(error).partition(": ")
        if name not in names:
            raise
        raise InputError(f"--{name.replace('_', '-')}{colon}{rest}") from None


def _value(text: str) -> Any:
    """Convert a value of ``--set`` to True, False or None; return other values as text."""
    return {"true": True, "false": False, "none": None}.get(text.lower(), text)


def _refuse_overwriting(given: Mapping[str, Any]) -> None:
    """Raise an error if an output is an input, is in an input folder, or has the path of another output."""
    written: list[Path] = []
    read: list[Path] = []
    for name, value in given.items():
        for one in value if isinstance(value, list | tuple) else [value]:
            if isinstance(one, str | os.PathLike) and str(one):
                (written if name in OUTPUTS else read).append(Path(one))
    try:
        inputs = {path.resolve() for path in read if path.is_file()}
        folders = {path.resolve() for path in read if path.is_dir()}
        targets = [path.resolve() for path in written]
    except (OSError, ValueError) as error:
        raise InputError(f"{error}; expected the name of a file; correct it") from None
    output = given.get("output")
    if output and output.suffix and not output.parent.is_dir():
        remedy = f"make it first: mkdir -p {output.parent}"
        raise refusal(output, "", "a folder that does not exist", "a place to write", remedy)
    for path, target in zip(written, targets, strict=True):
        if target in inputs or folders & {target, *target.parents} or targets.count(target) > 1:
            raise refusal(
                path, "", "an output that is also read or written", "a new name", "choose another name"
            )


def numbers(flag: str, text: str, count: int | None = None) -> list[float]:
    """Parse the value of an option: `count` numbers, separated by commas."""
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = []
    if not found or count not in (None, len(found)):
        expected = f"{count or 'some'} numbers"
        raise refusal("", flag, shown(text), expected, "write them with commas between, as 0,2")
    return found


def progress_bar(items: Iterable[Any], label: str) -> Iterable[Any]:
    """Iterate over items with a progress bar on the terminal."""
    with click.progressbar(items, label=label, file=sys.stderr) as bar:
        yield from bar
