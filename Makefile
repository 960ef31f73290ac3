# Each of these commands works alone, first, in a fresh clone: it makes the environment it needs.
#   make run     set up and run the main job: solve a bundled spec and have MuJoCo validate the motion
#   make test    set up and run all tests
#   make check   format, lint, types, import contracts, quick tests: what to run before a commit
#   make docs    set up and build the site of docs/ in build/site
#   make dist    build the source distribution and the wheels for all platforms in dist/
#   make bench   set up with the other tools, measure, and write the tables and plots of docs/benchmarks.md
VENV ?= .venv
WHEELS ?= manylinux2014_x86_64 manylinux2014_aarch64 macosx_11_0_arm64 win_amd64
SPEC ?= luxo_jump
BIN := $(VENV)/bin
# The first Python on the path that is new enough.
PYTHON ?= $(shell for p in python3.13 python3.12 python3.11 python3.14 python3 python; do \
	"$$p" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && { echo "$$p"; break; }; done)
RECIPE := pyproject.toml setup.py build_backend/backend.py $(wildcard stc/core/*.[ch] stc/core/*/*.[ch] stc/core/compiling.py)
# A module's tests stay together: they share what it solves once.  A worker that dies is not replaced, since pytest-xdist
# may wait for ever for one that is: what it had left to do is not run, and the run fails.  Slow files come first.
PYTEST := $(BIN)/python -m pytest -q -n auto --dist loadfile --no-loadscope-reorder --max-worker-restart 0

# With this variable every process would compile all modules that it imports: half of the time of a short command.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: run test check nightly format bench docs gallery dist check-dist tree clean

run: $(VENV)/.ready
	$(BIN)/stc run $(SPEC) -o out/$(SPEC).npz --report out/$(SPEC).html

test: $(VENV)/.ready-dev
	$(PYTEST)

nightly: $(VENV)/.ready-dev
	$(PYTEST) -m ""

check: $(VENV)/.ready-dev tree
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy -p stc
	cd build/tree && $(abspath $(BIN))/lint-imports --config ../../pyproject.toml --no-logo
	$(PYTEST) -x -m "not nightly and not slow"

format: $(VENV)/.ready-dev
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

# BENCH="peers cold --quick" measures a part of it; `python -m bench --help` tells which there are.
bench: $(VENV)/.ready-bench
	$(BIN)/python -m bench $(BENCH)

docs: $(VENV)/.ready-docs tree
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict

# Solves, judges and films every motion that ships; half an hour.
gallery: $(VENV)/.ready
	$(BIN)/python -m bench.gallery

# Wheels are built from the source distribution, which therefore lacks nothing.  The core is compiled by the package
# ziglang, for this machine and others.
dist: $(VENV)/bin/python
	rm -rf dist
	$(BIN)/python -m pip install --quiet build
	for platform in $(WHEELS); do \
		STC_WHEEL_PLATFORM=$$platform $(BIN)/python -m build --outdir dist || exit 1; \
	done

# Installs them in new environments, one for each Python from 3.11 on that is here; some minutes.
check-dist: dist
	$(BIN)/python build_backend/check_dist.py dist

# The package as it is imported, stc.validate and all, made of links: for tools that read files and not modules.
tree:
	rm -rf build/tree && mkdir -p build/tree/stc
	ln -s $(CURDIR)/stc/* $(CURDIR)/validate $(CURDIR)/models $(CURDIR)/specs build/tree/stc/

$(VENV)/bin/python:
	@test -n "$(PYTHON)" || { echo "stc needs Python 3.11 or later; name one with: make PYTHON=/path/to/python" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/.ready: $(RECIPE) | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --editable .
	touch $@

# Not compiled ahead: most of what these packages hold is never imported.
$(VENV)/.ready-dev: $(RECIPE) | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --no-compile --editable '.[dev]'
	touch $(VENV)/.ready $@

$(VENV)/.ready-docs: $(RECIPE) | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --editable '.[docs]'
	touch $(VENV)/.ready $@

$(VENV)/.ready-bench: $(RECIPE) | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --editable '.[bench]'
	-$(BIN)/python -m pip install --quiet --editable '.[bench,bench-more]'
	touch $(VENV)/.ready $@

clean:
	rm -rf build dist out *.egg-info .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
