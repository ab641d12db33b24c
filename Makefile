# `make demo` and `make test` need Python 3.11 or newer and nothing else; both fill .venv first.
# The interpreter may be named: make PYTHON=python3.12 demo

SHELL := /bin/sh
export PYTHON
# Hundreds of processes that the tests start import the package: it is compiled once, not in each.
unexport PYTHONDONTWRITEBYTECODE

VENV := .venv
BIN := $(VENV)/bin
# Python compiles what is imported; pip would compile all that is installed, on one core.
PIP := $(BIN)/python -m pip install -qq --no-compile --disable-pip-version-check -c .ci/constraints.txt
PYTEST := $(BIN)/python -m pytest

# Tests run in as many processes as there are cores. Threads of BLAS in each of them would wait for
# one another by spinning: two tests of 20 s, side by side on two cores, took 210 s.
test test-all test-slow goldens: export OPENBLAS_NUM_THREADS := 1

# One stamp per extra, so that a second call installs nothing and the demo does not wait for test
# tools. The environment has one too: its python is a link, and shows the age of what it links to.
VENV_READY := $(VENV)/venv.stamp
DEMO_READY := $(VENV)/demo.stamp
TEST_READY := $(VENV)/test.stamp
NODE_READY := $(VENV)/node.stamp
PAGES_READY := $(VENV)/pages.stamp
LINT_READY := $(VENV)/lint.stamp
DOCS_READY := $(VENV)/docs.stamp
BENCH_READY := $(VENV)/bench.stamp
RELEASE_READY := $(VENV)/release.stamp

.DELETE_ON_ERROR:
.NOTPARALLEL:
.PHONY: help ready demo test test-all test-slow test-elsewhere lint format types budget goldens update-goldens docs pictures course bench bench-table matrix clean

help:
	@echo "make demo            compile the wrecker boom, run it, show it on a page"
	@echo "make test            run the tests (4 minutes)     make test-all     and the exhaustive rest"
	@echo "make test-elsewhere  what computes, as on an older processor: numbers in emitted text are the same"
	@echo "make lint            ruff; tsc, eslint of pages    make format       repair what ruff can"
	@echo "make types           mypy                          make bench        the benchmarks"
	@echo "make budget          count the lines and what new things touch; fail above .ci/budget.toml"
	@echo "make goldens         compare generated/ with re-emission, under several hash seeds"
	@echo "make update-goldens  rewrite generated/"
	@echo "make docs            the site: open site/index.html     make course   lessons to take along"
	@echo "make pictures        the pictures, the notebooks and docs/joints.md"
	@echo "make matrix          what is released, on each Python that is here, with the oldest and newest dependencies"
	@echo "make clean           remove what make has made"

# All that CI needs: what comes after it may run side by side.
ready: $(PAGES_READY) $(LINT_READY) $(DOCS_READY)

$(VENV_READY): .ci/make-venv
	@echo "Making the virtual environment $(VENV)"
	@.ci/make-venv $(VENV)
	@touch $@

$(DEMO_READY): $(VENV_READY) pyproject.toml .ci/constraints.txt
	@echo "Installing kincompile into $(VENV)"
	@$(PIP) --editable .
	@touch $@

$(TEST_READY): $(DEMO_READY)
	@echo "Installing the test tools into $(VENV)"
	@$(PIP) --editable '.[test,plot,sweep,dxf,watch,stiff,jax,robots]'
	@touch $@

# What checks the pages, their scripts and what a browser makes of them, is of npm.
$(NODE_READY): $(TEST_READY) .ci/page/package-lock.json
	@echo "Installing tsc, eslint and axe-core into .ci/page"
	@PATH="$(CURDIR)/$(BIN):$$PATH" npm ci --prefix .ci/page --silent
	@touch $@

$(PAGES_READY): $(NODE_READY)
	@echo "Installing what reads notebooks, drives a browser and grades courses into $(VENV)"
	@$(PIP) --editable '.[pages,courses,oracles]'
	@touch $@

$(LINT_READY): $(NODE_READY)
	@echo "Installing ruff and mypy into $(VENV)"
	@$(PIP) --editable '.[lint]'
	@touch $@

demo: $(DEMO_READY)
	@mkdir -p demo
	@$(BIN)/kincompile compile examples/wrecker_boom.py -o demo/wrecker_boom_kinematics.py
	@$(BIN)/kincompile run examples/wrecker_boom.py -o demo/wrecker_boom.csv
	@$(BIN)/kincompile view examples/wrecker_boom.py -o demo/wrecker_boom.html
	@echo
	@echo "Written:"
	@echo "  demo/wrecker_boom_kinematics.py  Phi, Phi_q, nu and gamma as a NumPy module, to read or to import"
	@echo "  demo/wrecker_boom.csv            position, velocity and acceleration over time"
	@echo "  demo/wrecker_boom.html           the motion on a page: open it in a browser"

test: $(TEST_READY)
	@$(PYTEST) --numprocesses=auto --dist=loadfile

# In one run, both together make what they share once.
test-all: $(PAGES_READY)
	@$(PYTEST) --numprocesses=auto --dist=loadfile -m "slow or not slow"

# The exhaustive rest: packaging, pages in a browser, large corpora.
test-slow: $(PAGES_READY)
	@$(PYTEST) --numprocesses=auto --dist=loadfile -m slow

# An older processor: other kernels of OpenBLAS, in two threads, and NumPy and libm without AVX2 and
# FMA. Each rounds in its own way; variables that a system does not know do nothing. NumPy names its
# features. Folders whose tests do not compute (words, files, pages, messages) run in `make test` alone.
ROUNDED := $(addprefix tests/,adversary goldens physics targets trust unit/test_readme.py) \
	$(addprefix tests/unit/,calculus compare constraints derivation derive design dynamics ir model \
	runtime solver spatial structure targets transmissions)
# In these folders, what reads and refuses files and arguments, looks at text and shapes, or computes
# on a processor that QEMU emulates: no number that this processor computes is compared.
NOT_ROUNDED := $(addprefix --ignore=tests/,adversary/test_arguments.py adversary/test_budgets.py \
	adversary/test_files.py adversary/test_names.py adversary/test_stores.py \
	targets/test_controller.py targets/test_new_target.py targets/test_reserved_names.py \
	unit/model/test_declared.py unit/model/test_safe_expressions.py \
	unit/targets/test_contract_inputs.py unit/targets/test_contract_shapes.py)
FEATURES := from numpy._core._multiarray_umath import __cpu_dispatch__ as names; print(*names)
test-elsewhere: export OPENBLAS_CORETYPE := Haswell
test-elsewhere: export OPENBLAS_NUM_THREADS := 2
test-elsewhere: export GLIBC_TUNABLES := glibc.cpu.hwcaps=-AVX2,-FMA,-AVX2_Usable,-FMA_Usable
test-elsewhere: $(TEST_READY)
	@NPY_DISABLE_CPU_FEATURES="$$($(BIN)/python -c '$(FEATURES)')" $(PYTEST) --numprocesses=auto --dist=loadfile -m "not slow or printed" $(ROUNDED) $(NOT_ROUNDED)

# A page is of the plane or of space; what watches a file is no module.
PAGES := plane space watch
NODE_TOOL := PATH="$(CURDIR)/$(BIN):$$PATH" .ci/page/node_modules/.bin

lint: $(LINT_READY)
	@$(BIN)/ruff check --quiet
	@$(BIN)/ruff format --quiet --check
	@$(BIN)/ruff check --quiet --isolated --select E9,F generated
	@for page in $(PAGES); do $(NODE_TOOL)/tsc --project .ci/page/tsconfig.$$page.json || exit 1; done
	@$(NODE_TOOL)/eslint --config .ci/page/eslint.config.js templates/view templates/javascript

format: $(LINT_READY)
	@$(BIN)/ruff check --fix
	@$(BIN)/ruff format

types: $(LINT_READY)
	@$(BIN)/mypy

budget: $(VENV_READY)
	@$(BIN)/python .ci/budget.py

# Emission must not depend on the order of a set: the same bytes under every hash seed.
goldens: $(TEST_READY)
	@$(PYTEST) --numprocesses=auto -m "slow or not slow" tests/goldens

# Fails by design after a rewrite, so that nothing passes by updating.
update-goldens: $(TEST_READY)
	@$(PYTEST) tests/goldens tests/unit/test_joints_page.py --update-goldens -k 'golden or catalogue'

$(DOCS_READY): $(DEMO_READY)
	@echo "Installing what makes the site into $(VENV)"
	@$(PIP) --editable '.[docs]'
	@touch $@

# A warning is an error: a link that leads nowhere, a page that no page lists, a docstring that cannot be read.
docs: $(DOCS_READY)
	@$(BIN)/python -m sphinx --quiet --fail-on-warning --keep-going -b html docs site
	@echo "The site begins at site/index.html"

# What the README and docs/ show, made by the tool; tests compare it.
pictures: $(DOCS_READY)
	@for what in pictures joints notebooks; do $(BIN)/python -m docs.builders $$what || exit 1; done

course: $(DOCS_READY)
	@rm -rf course
	@$(BIN)/python -m docs.builders course course --mistakes
	@$(BIN)/python -m pip wheel -qq --disable-pip-version-check --no-deps --wheel-dir course .
	@echo "The course begins at course/index.html"

# A peer that cannot be installed here is skipped, and the tables say so.
$(BENCH_READY): $(DEMO_READY)
	@echo "Installing the peers of the benchmarks into $(VENV)"
	@$(PIP) --editable '.[bench]' || echo "Not all peers can be installed."
	@touch $@

bench: $(BENCH_READY)
	@$(BIN)/python -m benchmarks
	@for part in points analysis space stepper in_jax outputs sensitivities forces forward scale variants sweep synthesis page; do $(BIN)/python -m benchmarks.$$part || exit 1; done

bench-table: $(BENCH_READY)
	@$(BIN)/python -m benchmarks.table

$(RELEASE_READY): $(DEMO_READY)
	@echo "Installing what builds and installs a release into $(VENV)"
	@$(PIP) --editable '.[release]'
	@touch $@

# MATRIX_TESTS="tests/unit/model -x" is a part of the tests.
matrix: export OPENBLAS_NUM_THREADS := 1
matrix: $(RELEASE_READY)
	@$(BIN)/python .ci/matrix.py

clean:
	@rm -rf $(VENV) demo site course docs/made build dist *.egg-info .hypothesis .mypy_cache .pytest_cache .ruff_cache
	@find . -name __pycache__ -type d -prune -exec rm -rf {} +
