# `make demo` and `make test` do all the set-up themselves on a fresh Debian or Ubuntu machine.

VENV := .venv
BIN := $(VENV)/bin
PYTHON ?= python3
PIP_INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check
DEMO_RESULTS := demo-results
WORKERS := 2

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:

.PHONY: help
help: ## list the targets
	@grep -E '^[a-z-]+:.*## ' Makefile | sed -E 's/^([a-z-]+):.*## /\1|/' | awk -F'|' '{printf "  make %-8s %s\n", $$1, $$2}'

# --- set-up ---------------------------------------------------------------------------------------------

# On Debian, venv is in a separate package with the version in its name: python3.11-venv.
define CREATE_VENV
set -eu
as_root() { if [ "$$(id -u)" = 0 ]; then "$$@"; else sudo "$$@"; fi; }
apt_install() {
    command -v apt-get >/dev/null || { echo "make: please install $$* and try again" >&2; exit 1; }
    echo "Installing $$* with apt-get"
    as_root apt-get update -qq </dev/null
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends "$$@" </dev/null >/dev/null
}
apt_try() {
    command -v apt-get >/dev/null || return 1
    if [ "$$(id -u)" != 0 ]; then sudo -n true 2>/dev/null || return 1; fi
    ( apt_install "$$@" )
}
command -v $(PYTHON) >/dev/null || apt_install $(PYTHON) $(PYTHON)-venv
$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || {
    echo "make: posekit needs Python 3.11 or newer, $(PYTHON) is $$($(PYTHON) -c 'import platform; print(platform.python_version())'): install one and name it, as in: make PYTHON=python3.12 $(MAKECMDGOALS)" >&2
    exit 1
}
$(PYTHON) -m venv --clear $(VENV) >/dev/null 2>&1 || {
    apt_install "$$($(PYTHON) -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')"
    $(PYTHON) -m venv --clear $(VENV)
}
# The solver is compiled if a compiler exists or can be installed; otherwise its NumPy reference is used.
command -v g++ >/dev/null || command -v c++ >/dev/null || apt_try g++ $$(dpkg -s python3 >/dev/null 2>&1 && echo python3-dev) || echo "make: no C++ compiler was found and none could be installed: the slower reference solver is used" >&2
# Pinocchio's wheel needs GNU's OpenMP library but does not contain it; a minimal Debian does not have it.
$(PYTHON) -c 'import ctypes; ctypes.CDLL("libgomp.so.1")' 2>/dev/null || apt_install libgomp1
endef
export CREATE_VENV

$(BIN)/python:
	@bash -c "$$CREATE_VENV"

# There is no build isolation, because constraints.txt also pins setuptools and pybind11. Changed C++ is recompiled.
COMPILED := setup.py $(wildcard posekit/*/*.cpp posekit/*/*.hpp)
$(VENV)/runtime.stamp: pyproject.toml constraints.txt $(COMPILED) | $(BIN)/python
	@echo "Installing posekit into $(VENV)"
	@$(PIP_INSTALL) -c constraints.txt --upgrade setuptools pybind11
	@$(PIP_INSTALL) -c constraints.txt --no-build-isolation -e '.[pictures]'
	@touch $@

$(VENV)/dev.stamp: $(VENV)/runtime.stamp
	@echo "Installing the tools for tests and docs into $(VENV)"
	@$(PIP_INSTALL) -c constraints.txt --no-build-isolation -e '.[dev,docs]'
	@touch $@

.PHONY: venv
venv: $(VENV)/dev.stamp ## create .venv with all dependencies

.PHONY: hooks
hooks: $(VENV)/dev.stamp ## run the quick checks before each git commit
	$(BIN)/pre-commit install

# Versions are resolved for Python 3.11.0, the oldest supported version, so that they also work with later versions.
# Debian 12 has 3.11.2, but some packages need 3.11.5.
LOCK_PYTHON ?= python3.11
define WRITE_LOCK
set -euo pipefail
fresh=$$(mktemp -d)
trap 'rm -rf "$$fresh"' EXIT
$(LOCK_PYTHON) -m venv "$$fresh"
"$$fresh/bin/python" -m pip install --quiet --disable-pip-version-check --upgrade pip setuptools pybind11
"$$fresh/bin/python" -m pip install --quiet --disable-pip-version-check --dry-run --ignore-installed \
    --python-version 3.11.0 --only-binary :all: --no-build-isolation --report "$$fresh/report.json" \
    setuptools pybind11 '.[dev,docs]'
"$$fresh/bin/python" - "$$fresh/report.json" >constraints.txt.new <<'SCRIPT'
import json, pathlib, sys
found = [entry["metadata"] for entry in json.loads(pathlib.Path(sys.argv[1]).read_text())["install"]]
pins = [(item["name"], item["version"]) for item in found if item["name"] != "posekit"]
print("# What make installs, to the exact version. Written by `make lock`, for Python 3.11 and later: do not edit.")
print(*(f"{name}=={version}" for name, version in sorted(pins, key=lambda pin: pin[0].lower())), sep="\n")
SCRIPT
mv constraints.txt.new constraints.txt
endef
export WRITE_LOCK

.PHONY: lock
lock: ## update constraints.txt to the newest versions that pyproject.toml allows
	@bash -c "$$WRITE_LOCK"

# Pictures need Chromium or Chrome. If no browser is installed, Debian's Chromium is installed if possible; without a
# browser everything except pictures works.
define FIND_BROWSER
for browser in $${POSEKIT_BROWSER:-} chromium chromium-browser google-chrome google-chrome-stable chrome; do
    if command -v "$$browser" >/dev/null; then exit 0; fi
done
as_root() { if [ "$$(id -u)" = 0 ]; then "$$@"; elif command -v sudo >/dev/null; then sudo -n "$$@"; else false; fi; }
if command -v apt-get >/dev/null && as_root true 2>/dev/null; then
    echo "Installing chromium with apt-get"
    as_root apt-get update -qq </dev/null || true
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends chromium </dev/null >/dev/null && exit 0
fi
echo "make: no Chromium or Chrome was found and none could be installed: there will be no pictures" >&2
endef
export FIND_BROWSER

.PHONY: browser
browser: ## install Debian's chromium if no browser is found
	@bash -c "$$FIND_BROWSER"

# --- the main job ---------------------------------------------------------------------------------------

.PHONY: demo
demo: $(VENV)/runtime.stamp browser ## run posekit on the built-in views, results in demo-results/
	$(BIN)/posekit demo -o $(DEMO_RESULTS)

.PHONY: dist
dist: $(VENV)/dev.stamp ## build wheel and sdist into dist/
	$(BIN)/python -m build --no-isolation --outdir dist .

.PHONY: newcomer
newcomer: $(VENV)/dev.stamp ## measure the time from a clone to the first picture and to each tutorial's result
	$(BIN)/python -m benchmarks.newcomer

# --- checks ---------------------------------------------------------------------------------------------

.PHONY: test
test: $(VENV)/dev.stamp browser ## run the tests
	$(BIN)/python -m pytest -n $(WORKERS) tests

.PHONY: format
format: $(VENV)/dev.stamp ## rewrite the code in the project's format
	$(BIN)/ruff check --fix-only .
	$(BIN)/ruff format .

.PHONY: lint
lint: $(VENV)/dev.stamp ## ruff: format and rules
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .

.PHONY: types
types: $(VENV)/dev.stamp ## mypy --strict
	$(BIN)/mypy posekit tests $(wildcard benchmarks/*.py examples/*.py)

.PHONY: layers
layers: $(VENV)/dev.stamp ## import-linter: allowed imports between packages
	$(BIN)/lint-imports

.PHONY: docs
docs: $(VENV)/dev.stamp browser ## build the documentation, warnings are errors
	$(BIN)/sphinx-build -j $(WORKERS) -W --keep-going -q -b html docs docs/_build/html
	@echo "docs/_build/html/index.html"

.PHONY: count
count: ## print the number of lines of code, files, tests and documentation
	@$(PYTHON) benchmarks/count.py

.PHONY: check
check: lint types layers docs test count ## all of the above, as CI does

BENCHMARKS := clean_clips defects formats people peers repair robots solver start_up tree
.PHONY: bench
bench: $(VENV)/dev.stamp ## measure quality and speed
	@for name in $(BENCHMARKS); do echo "== $$name"; $(BIN)/python -m benchmarks.$$name || exit 1; done

.PHONY: fuzz
fuzz: $(VENV)/dev.stamp ## test every reader and command with damaged files for an hour
	$(BIN)/python -m benchmarks.fuzz -o fuzz-results --seconds 3600

.PHONY: clean
clean: ## remove all files created by make
	rm -rf $(VENV) build dist *.egg-info docs/_build $(DEMO_RESULTS)
	rm -rf .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	find posekit validators urdf viewer tests benchmarks -name __pycache__ -type d -prune -exec rm -rf {} + 2>/dev/null || true
