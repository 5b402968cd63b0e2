"""JSON as `posekit.safe_io` reads it, under the names by which the other files of this folder know it."""

from posekit.safe_io.json_file import MAX_BYTES, parse_json, read_json

__all__ = ["MAX_BYTES", "parse_json", "read_json"]
