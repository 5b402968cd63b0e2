"""The package as it is installed: its version, its files, and an import that does nothing else."""

import importlib.metadata
import importlib.util
import inspect
import re
import subprocess
import sys
import tomllib
from importlib import import_module
from importlib.resources import files
from pathlib import Path

import pytest

import posekit

ROOT = Path(__file__).resolve().parents[1]
LINKED = ("urdf", "validators", "viewer")

# Reports every file opened for writing, socket, process and logging handler between the two marks.
IMPORT_AND_REPORT = """
import logging, os, sys, threading
seen = []
watched = {"socket.__new__", "socket.connect", "socket.bind", "subprocess.Popen", "os.system", "os.mkdir"}
def hook(event, args):
    if event in watched:
        seen.append(event)
    if event == "open" and isinstance(args[2], int) and args[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT):
        seen.append(f"open {args[0]}")
sys.dont_write_bytecode = True
modules = MODULES
sys.addaudithook(hook)
for module in modules:
    __import__(module)
seen += [f"handler {handler}" for handler in logging.getLogger().handlers]
seen += [f"handler {handler}" for handler in logging.getLogger("posekit").handlers]
seen += [f"thread {thread}" for thread in threading.enumerate() if thread is not threading.main_thread()]
print("\\n".join(seen))
"""


def run_python(code: str) -> str:
    command = [sys.executable, "-W", "error", "-c", code]
    finished = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60, cwd=ROOT)
    assert finished.returncode == 0, finished.stderr
    assert finished.stderr == ""
    return finished.stdout.strip()


def test_version_is_that_of_pyproject() -> None:
    import posekit

    try:
        importlib.metadata.version("posekit")
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("posekit is imported from its folder, not installed")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert posekit.__version__ == project["version"]


def test_import_does_nothing_else() -> None:
    modules = ["posekit", "posekit.skeleton", "posekit.errors"]
    assert run_python(IMPORT_AND_REPORT.replace("MODULES", repr(modules))) == ""


@pytest.mark.parametrize("heavy", ["pinocchio", "coal", "meshcat", "pydantic", "yourdfpy"])
def test_cameras_and_tree_are_numpy_alone(heavy: str) -> None:
    code = f"import sys, posekit.cameras, posekit.skeleton, posekit.tree; print({heavy!r} in sys.modules)"
    assert run_python(code) == "False"


def test_exact_frames_load_nothing_of_refinement() -> None:
    code = (
        "import sys, numpy, posekit\n"
        "from posekit.synthesis import random_views\n"
        "from posekit.views.builtin import view_of\n"
        "scene = random_views(posekit.load_figure(), 2, numpy.random.default_rng(0))\n"
        "frames = posekit.recover(view_of(scene)).frames\n"
        "loaded = any(name.startswith('posekit.refinement') for name in sys.modules)\n"
        "print({frame.judged for frame in frames}, loaded)"
    )
    assert run_python(code) == "{'exact'} False"


def test_unknown_attribute_is_an_attribute_error() -> None:
    import posekit

    name = "no_such_name"
    with pytest.raises(AttributeError, match=name):
        getattr(posekit, name)


@pytest.mark.parametrize("name", ["py.typed", "urdf/stick_figure.urdf", "urdf/stick_figure.srdf"])
def test_data_files_are_in_the_package(name: str) -> None:
    assert files("posekit").joinpath(name).is_file()


def test_linked_folders_are_packages_of_posekit() -> None:
    for name in LINKED:
        link = ROOT / "posekit" / name
        if link.exists():
            assert link.is_symlink()
            assert not link.readlink().is_absolute()
            assert link.resolve() == ROOT / name


def test_test_files_have_unique_names() -> None:
    names = [path.name for path in (ROOT / "tests").rglob("test_*.py")]
    assert len(names) == len(set(names))


def test_the_api_page_lists_every_module() -> None:
    spec = importlib.util.spec_from_file_location("make_api", ROOT / "docs" / "make_api.py")
    assert spec is not None
    assert spec.loader is not None
    page = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(page)
    assert (ROOT / "docs" / "api.md").read_text(encoding="utf-8") == page.text(), (
        "run: python docs/make_api.py"
    )


def lazy_packages() -> list[str]:
    """Name the packages whose names are loaded on demand."""
    root = Path(posekit.__file__).parent
    return sorted(
        ".".join(("posekit", *path.parent.relative_to(root).parts))
        for path in [*root.rglob("__init__.py"), *(root / "validators").rglob("__init__.py")]
        if "on_demand(" in path.read_text(encoding="utf-8")
    )


@pytest.mark.parametrize("package", lazy_packages())
def test_names_that_are_loaded_on_demand_are_those_that_types_are_checked_by(package: str) -> None:
    module = import_module(package)
    source = Path(str(module.__file__)).read_text(encoding="utf-8")
    said = re.findall(rf"^    from {re.escape(package)}\.(\S+) import (\w+) as \2$", source, re.MULTILINE)
    offered = inspect.getclosurevars(module.__getattr__).nonlocals["home"]
    assert offered == {name: f"{package}.{inside}" for inside, name in said}
    for name, home in offered.items():
        assert getattr(module, name) is getattr(import_module(home), name)
        with pytest.raises(ImportError):  # the import system would set such a name to the module
            import_module(f"{package}.{name}")


@pytest.mark.parametrize(
    ("raised", "said"),
    [
        ("ImportError('libgomp.so.1: cannot open shared object file')", "apt-get install libgomp1"),
        (
            "ImportError('libodd.so.7: cannot open shared object file', name='pinocchio')",
            "which pinocchio needs",
        ),
        ("MemoryError()", "not enough memory"),
    ],
)
def test_what_the_system_lacks_is_one_line(raised, said, tmp_path):
    broken = tmp_path / "pinocchio.py"
    broken.write_text(f"raise {raised}\n", encoding="utf-8")
    code = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r}); sys.argv = ['posekit', 'demo', '-o', 'never']; "
        "from posekit.cli import main; main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith("posekit: error: ")
    assert said in line
    assert not (tmp_path / "never").exists()
