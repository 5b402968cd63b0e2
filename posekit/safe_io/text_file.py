"""Text: a regular file in UTF-8, of bounded size, without NUL."""

from __future__ import annotations

from pathlib import Path

from posekit.safe_io.refusal import refusal
from posekit.safe_io.regular_file import read_bytes


def read_text(path: str | Path, *, limit: int, too_large: str = "split it") -> str:
    """Read a text file.

    Parameters
    ----------
    path : path
        A regular file in UTF-8.
    limit : int
        Bytes that it may have.
    too_large : str
        What to do about a file that is larger.

    Returns
    -------
    str
        The text, without a byte order mark; line ends are those of the file.

    Raises
    ------
    InputError
        Where it cannot be read, is too large, is not UTF-8 or holds a NUL character.
    """
    return decode(path, read_bytes(path, limit=limit, too_large=too_large))


def decode(source: str | Path, data: bytes) -> str:
    """Decode bytes that came from `source`, with the checks of `read_text`."""
    data = data.removeprefix(b"\xef\xbb\xbf")
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        byte = f"0x{data[error.start]:02x}"
        remedy = "save the file as UTF-8, or check that it is text at all"
        raise refusal(source, f"byte {error.start}", byte, "text in UTF-8", remedy) from None
    if "\0" in text:
        place = f"byte {len(text[: text.index(chr(0))].encode())}"
        raise refusal(source, place, "a NUL character", "text in UTF-8", "check that it is text, not UTF-16")
    return text
