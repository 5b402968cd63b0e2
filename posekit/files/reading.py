"""JSON as `posekit.intake` reads it, under the names by which the other files of this folder know it."""

from posekit.intake.json_file import MAX_BYTES, parse_json, read_json

__all__ = ["MAX_BYTES", "parse_json", "read_json"]
