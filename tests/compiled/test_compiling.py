"""When Numba is loaded, and what is said where it cannot be."""

from types import SimpleNamespace

import pytest

from posekit.compiled import compiling as compiled


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
