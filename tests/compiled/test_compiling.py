"""When Numba is loaded, and what is said where it cannot be."""

from types import SimpleNamespace

import pytest

from posekit.compiled import compiling as compiled
from posekit.compiled import posture_kernels


def test_numba_is_loaded_only_when_it_pays(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def load() -> SimpleNamespace:
        asked.append(1)
        return SimpleNamespace()

    monkeypatch.setattr(compiled, "_numba", load)
    monkeypatch.setattr(compiled._State, "grown", 0)
    assert not compiled.is_fast(compiled.PAYS_FROM)
    assert not asked
    assert compiled.is_fast(1)
    monkeypatch.setattr(compiled, "_numba", lambda: None)
    assert not compiled.is_fast(10**9)


@pytest.mark.parametrize(
    ("error", "says"),
    [
        (ModuleNotFoundError("numba"), r"not installed, .* install it: pip install 'posekit\[fast\]'"),
        (
            ImportError("Numba needs NumPy 2.5 or less"),
            "Numba cannot be used, the slower path is taken: Numba needs",
        ),
    ],
)
def test_numba_that_cannot_be_used_is_done_without_and_said(
    monkeypatch: pytest.MonkeyPatch, error: ImportError, says: str
) -> None:
    def fail(name: str) -> None:
        raise error

    monkeypatch.setattr(compiled, "import_module", fail)
    with pytest.warns(UserWarning, match=says):
        assert compiled._numba.__wrapped__() is None


def test_what_is_compiled_anew_is_told_once(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[int] = []
    monkeypatch.setattr(compiled._State, "tell", None)
    compiled.when_compiling(lambda: told.append(1))
    kept = SimpleNamespace(stats=SimpleNamespace(cache_misses={}))
    new = SimpleNamespace(stats=SimpleNamespace(cache_misses={"types": 1}))
    assert compiled._told(kept) is kept and told == []
    assert compiled._told(new) is new and compiled._told(new) is new
    assert told == [1]


def test_functions_that_nothing_calls_are_left_out() -> None:
    names = set(compiled._called(compiled._of(posture_kernels), posture_kernels.COMPILED_TYPES))
    assert {"descend_postures", "limb_block", "beyond_limits", "bounds"} <= names
    assert "limbs_read" not in names
