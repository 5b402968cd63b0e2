"""Reader of named arrays in NPZ, NPY, pickle, joblib and PyTorch files; it never runs code from a file."""

from __future__ import annotations

import io
import math
import operator
import pickle
import pickletools
import struct
import tokenize
import warnings
import zipfile
import zlib
from typing import Any, ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError, TooLargeError, one_line, refusal, shown
from posekit.files import MAX_BYTES

#: Names that a pickle may use, by module and name.
Named = dict[tuple[str, str], Any]

MAX_MEMBERS: Final = 10_000
#: Errors of NumPy, zipfile and pickle for damaged files.
_DAMAGED: Final = (
    *(ValueError, TypeError, LookupError, ArithmeticError, AttributeError, RuntimeError, OSError, EOFError),
    *(MemoryError, AssertionError, SyntaxError, SystemError, struct.error, zlib.error, tokenize.TokenError),
    *(zipfile.BadZipFile, pickle.UnpicklingError),
)


def parse(data: bytes, source: str) -> dict[str, Any]:
    """Read named arrays, numbers, strings and plain containers.

    Returns
    -------
    dict
        Arrays by name; an array without a name has the key ``""``. If a pickled dict contains only one value, which is
        a dict, the result is that inner dict.

    Raises
    ------
    InputError
        If the file is damaged or too large, or contains anything but arrays, numbers, strings and plain containers.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # NumPy warns of headers written by earlier versions
            if data[:2] == b"PK":
                return _zip(data, source)
            if data[:6] == b"\x93NUMPY":
                return _named(_npy(io.BytesIO(data), source))
            found = unpickled(data, source)
    except InputError:
        raise
    except _DAMAGED as error:
        reason = one_line(str(error))[:100] or type(error).__name__
        raise refusal(source, "", f"a damaged file ({reason})", "arrays", "write or copy it again") from None
    return _named(found)


def _zip(data: bytes, source: str) -> dict[str, Any]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = archive.infolist()
        if len(members) > MAX_MEMBERS or sum(one.file_size for one in members) > MAX_BYTES:
            got = f"{sum(one.file_size for one in members):,} bytes when unpacked"
            raise refusal(source, "", got, f"at most {MAX_BYTES:,}", "cut it into clips", error=TooLargeError)
        torch = next((one.filename for one in members if one.filename.endswith("data.pkl")), None)
        if torch is not None:
            return _named(_torch(archive, torch, source))
        arrays = {}
        for one in members:
            name = one.filename.removesuffix(".npy")
            if name in arrays:
                raise refusal(source, name, "an array twice", "each name once", "write the file again")
            if one.filename.endswith(".npy"):
                arrays[name] = _plain_array(_npy(io.BytesIO(archive.read(one)), source))
    if not arrays:
        raise refusal(source, "", "a zip file without arrays", "an NPZ or PyTorch file", "check the file")
    return arrays


#: Largest code point of Unicode.
LAST_CHARACTER: Final = 0x10FFFF


def _npy(file: io.BytesIO, source: str) -> Any:
    """Read an array of an NPY file; the restricted unpickler `_Plain` reads arrays of objects."""
    version = np.lib.format.read_magic(file)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(file, max_header_size=100_000)
    if dtype.hasobject:
        return _unpickled(file, source)
    count = int(np.prod(shape, dtype=object))
    if count * max(dtype.itemsize, 1) > file.getbuffer().nbytes:
        raise ValueError(f"shape {shape}, but fewer bytes")
    file.seek(0)
    array = np.lib.format.read_array(file, allow_pickle=False)
    if array.dtype.kind == "U" and array.size and int(array.ravel().view(np.uint32).max()) > LAST_CHARACTER:
        raise ValueError("text with characters that do not exist")
    return array


def _named(found: Any) -> dict[str, Any]:
    """Return the arrays of a pickled dict, or of the only dict in it, by name; a sole array has the name ``""``."""
    found = _plain_array(found)
    while isinstance(found, list | tuple) and len(found) == 1 and isinstance(found[0], dict):
        found = found[0]
    if isinstance(found, dict):
        inner = next(iter(found.values()), None)
        if len(found) == 1 and isinstance(inner, dict):
            found = inner
        return {str(name): _plain_array(value) for name, value in found.items()}
    return {"": np.asarray(found) if isinstance(found, list | tuple) else found}


def _plain_array(value: Any) -> Any:
    """Convert an array of objects to a list, a scalar, or an array of text."""
    if isinstance(value, np.ndarray) and value.nbytes > MAX_BYTES:
        raise ValueError("an array larger than can be read")
    if isinstance(value, np.ndarray) and value.dtype.hasobject:
        value = value.item() if value.ndim == 0 else value.tolist()
    if isinstance(value, list) and value and all(isinstance(one, str) for one in value):
        return np.array(value, dtype=np.str_)
    return value


class _Pending:
    """An array, a data type, or joblib's header of an array, before its state is read from the pickle.

    NumPy's `__setstate__` is not called, because it does not check the state: a damaged state crashes the process.
    """

    kind = "joblib"
    spec: Any = ""
    order = "="
    value: Any = None

    def __init__(self, kind: str = "joblib", spec: Any = "") -> None:
        self.kind, self.spec = kind, spec

    def build(self, state: Any, file: io.BytesIO) -> Any:
        """Return the array that a pickled state describes; for a data type, set its byte order and return itself."""
        if self.kind == "dtype":
            if state[2] is not None or state[3] is not None or state[1] not in ("<", ">", "=", "|"):
                raise pickle.UnpicklingError("a compound data type")
            self.order = state[1]
            return self
        if self.kind == "array":
            _, shape, dtype, fortran, raw = state
            self.value = raw if isinstance(raw, list) else _array(raw, dtype, shape, "F" if fortran else "C")
            return self.value[0] if shape == () and isinstance(raw, list) else self.value
        if state.get("numpy_array_alignment_bytes") is not None:  # joblib, numpy_pickle.py
            file.read(file.read(1)[0])
        dtype, shape = state["dtype"], state["shape"]
        size = math.prod(map(operator.index, shape)) * _dtype_of(dtype).itemsize
        self.value = _array(file.read(max(size, 0)), dtype, shape, "F" if state.get("order") == "F" else "C")
        return self.value


def _dtype_of(pending: Any) -> np.dtype[Any]:
    if not isinstance(pending, _Pending) or pending.kind != "dtype" or not isinstance(pending.spec, str):
        raise pickle.UnpicklingError("no data type")
    dtype = np.dtype(pending.spec)
    if dtype.kind not in "biufcSU":
        raise pickle.UnpicklingError(f"the data type {dtype}")
    return dtype.newbyteorder(pending.order)  # type: ignore[arg-type]


def _array(raw: Any, dtype: Any, shape: Any, order: Any) -> NDArray[Any]:
    raw = raw.encode("latin1") if isinstance(raw, str) else raw
    flat = np.frombuffer(raw, _dtype_of(dtype))
    return flat.reshape([*map(operator.index, shape)], order="F" if order == "F" else "C").copy()


def _bytes(*arguments: Any) -> bytes:
    if arguments and not isinstance(arguments[0], list | tuple | bytes | bytearray):
        raise pickle.UnpicklingError("bytes of a length")  # bytes(10**12) would fill the memory
    return bytes(*arguments)


def _encoded(text: str, encoding: str = "latin1") -> bytes:
    if encoding not in ("latin1", "latin-1", "utf-8", "ascii"):
        raise pickle.UnpicklingError(f"the encoding {encoding}")
    return text.encode(encoding)


def _plain_names() -> dict[tuple[str, str], Any]:
    """Return the names that a pickle may use: constructors of arrays, numbers and plain containers."""
    found: dict[tuple[str, str], Any] = {
        ("numpy", "ndarray"): None,
        ("numpy", "dtype"): lambda spec, *_: _Pending("dtype", spec),
        ("collections", "OrderedDict"): dict,
        ("_codecs", "encode"): _encoded,
        ("joblib.numpy_pickle", "NumpyArrayWrapper"): _Pending,
    }
    for core in ("numpy.core", "numpy._core"):
        found[f"{core}.multiarray", "_reconstruct"] = lambda *_: _Pending("array")
        found[f"{core}.multiarray", "scalar"] = lambda dtype, raw: _array(raw, dtype, (), "C")[()]
        found[f"{core}.numeric", "_frombuffer"] = _array
    for module in ("builtins", "__builtin__"):
        for kind in (dict, list, tuple, set, frozenset, int, float, complex, bool, str):
            found[module, kind.__name__] = kind
        found |= {(module, "bytes"): _bytes, (module, "bytearray"): _bytes}
    return found


PLAIN_NAMES: Final = _plain_names()


class _Plain(pickle._Unpickler):
    """Unpickle arrays, numbers, strings and plain containers; refuse all objects that could run code.

    The base class is Python's slow unpickler, because joblib stores arrays inside the stream of the pickle.
    """

    stack: list[Any]
    dispatch: ClassVar[dict[int, Any]] = dict(pickle._Unpickler.dispatch)

    def __init__(self, file: io.BytesIO, source: str, extra: Named | None) -> None:
        super().__init__(file, encoding="latin1")
        self.stream, self.source, self.names = file, source, {**PLAIN_NAMES, **(extra or {})}

    def find_class(self, module: str, name: str) -> Any:
        """Return the object that a name in a pickle refers to, if it is allowed; refuse any other."""
        if (module, name) not in self.names:
            expected = "arrays, numbers, strings, lists and dicts"
            remedy = "save its arrays with numpy.savez"
            raise refusal(self.source, "", f"a pickle with {shown(f'{module}.{name}')}", expected, remedy)
        return self.names[module, name]

    def load_build(self) -> None:
        """Set the state of the object on the stack (instruction BUILD)."""
        state, target = self.stack.pop(), self.stack[-1]
        if not isinstance(target, _Pending):
            raise pickle.UnpicklingError("a state of an object that has none")
        self.stack[-1] = target.build(state, self.stream)

    dispatch[pickle.BUILD[0]] = load_build


def unpickled(data: bytes, source: str) -> Any:
    """Return the content of a pickle with the same nesting, and lists in place of tuples; its code is not run."""
    return _unpickled(io.BytesIO(_unpacked(data)), source)


def _unpickled(file: io.BytesIO, source: str, extra: Named | None = None, load: Any = None) -> Any:
    unpickler = _Plain(file, source, extra)
    if load is not None:
        setattr(unpickler, "persistent_load", load)  # noqa: B010
    return _resolved(unpickler.load())


def _resolved(found: Any) -> Any:
    """Replace each `_Pending` in nested containers by its array, and refuse functions and classes."""
    if isinstance(found, _Pending):
        return _resolved(found.value)
    if isinstance(found, dict):
        return {_resolved(key): _resolved(value) for key, value in found.items()}
    if isinstance(found, list | tuple):
        return [_resolved(one) for one in found]
    if callable(found):
        raise pickle.UnpicklingError("a function")
    return found


def _unpacked(data: bytes) -> bytes:
    """Decompress zlib data of joblib, and refuse data that do not start like a pickle."""
    if data[:1] == b"x":
        unpacker = zlib.decompressobj()
        data = unpacker.decompress(data, MAX_BYTES)
        if unpacker.unconsumed_tail:
            raise ValueError("more than can be unpacked")
    if not data or data[:1].decode("latin-1") not in {code.code for code in pickletools.opcodes}:
        raise pickle.UnpicklingError("no pickle")
    return data


_TORCH_TYPES: Final = {
    "FloatStorage": "<f4", "DoubleStorage": "<f8", "HalfStorage": "<f2", "LongStorage": "<i8", "IntStorage": "<i4",
    "ShortStorage": "<i2", "CharStorage": "i1", "ByteStorage": "u1", "BoolStorage": "?",
}  # fmt: skip


def _torch(archive: zipfile.ZipFile, member: str, source: str) -> Any:
    """Read tensors of a PyTorch zip file as arrays (pytorch, torch/serialization.py)."""
    folder = member.removesuffix("data.pkl")
    byteorder = folder + "byteorder"
    if byteorder in archive.namelist() and archive.read(byteorder) != b"little":
        raise ValueError("big-endian tensors")

    def storage(reference: Any) -> NDArray[Any]:
        kind, dtype, key, _, count = reference
        if kind != "storage" or not isinstance(key, str):
            raise pickle.UnpicklingError("an unknown reference")
        values = np.frombuffer(archive.read(f"{folder}data/{key}"), dtype)
        if len(values) < count:
            raise EOFError("a tensor is cut off")
        return values

    def tensor(values: NDArray[Any], offset: int, size: Any, stride: Any, *_: Any) -> NDArray[Any]:
        shape, steps = (tuple(map(operator.index, given)) for given in (size, stride))
        width = values.itemsize  # NumPy refuses strides that leave the storage
        strides = [step * width for step in steps]
        return np.ndarray(shape, values.dtype, values.tobytes(), offset * width, strides).copy()

    def parameter(values: Any, *_: Any) -> Any:
        return values

    extra: Named = {("torch", name): dtype for name, dtype in _TORCH_TYPES.items()}
    extra["torch._utils", "_rebuild_tensor_v2"] = tensor
    extra["torch._utils", "_rebuild_parameter"] = parameter
    return _unpickled(io.BytesIO(archive.read(member)), source, extra, storage)


def packed(arrays: dict[str, Any]) -> bytes:
    """Write named arrays as NPZ without pickles."""
    file = io.BytesIO()
    np.savez_compressed(file, allow_pickle=False, **arrays)
    return file.getvalue()
