"""Every physically possible human posture behind a single view, each one certified."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    __version__: str
else:

    def __getattr__(name: str) -> str:
        # Read when asked for: importing posekit does no I/O.
        if name == "__version__":
            from importlib.metadata import version  # noqa: PLC0415

            return version("posekit")
        raise AttributeError(f"module 'posekit' has no attribute {name!r}")
