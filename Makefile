# Two commands on a fresh machine (Python 3.11+, a C++20 compiler, make): `make run` and `make test`. `make help` lists the others.
# Each target makes .venv and installs what it needs from the package index.

PYTHON ?= $(shell for p in python3.13 python3.12 python3.11; do if $$p -c '' 2>/dev/null; then echo $$p; exit; fi; done; echo python3)
BIN := .venv/bin
CORE := CMakeLists.txt pyproject.toml $(shell find core/include python/src cmake -type f)
CPP_FILES = $$(find core python/src examples -name '*.hpp' -o -name '*.cpp')
PYTHON_FOLDERS = $(wildcard python experiments benchmarks tests examples/python)
OUT ?= results
CLANG ?= clang++
JOBS ?= 2
PYTEST = OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder
# Tests of what users build with palpate: installed headers, other compilers and machines. `make docs` runs those of the documentation.
BUILD_TESTS = tests/core/test_compiler_options.py tests/core/test_cross_compile.py tests/core/test_installed_core.py
FAST_TESTS = tests/test_import_graph.py tests/test_units.py tests/control tests/devices tests/linear tests/metrics tests/scenario

export PIP_DISABLE_PIP_VERSION_CHECK := 1
# Python compiles only the modules that it imports.
export PIP_NO_COMPILE := 1

.DEFAULT_GOAL := help
.PHONY: help run test sanitize builds check reproduce bench fuzz corefuzz mutate nightly docs wheel lint tidy format clean

help:  ## list the targets
	@sed -n 's/^\([a-z]*\):.*## \(.*\)/  make \1|\2/p' Makefile | awk -F'|' '{ printf "%-18s %s\n", $$1, $$2 }'

run: .venv/installed  ## install, run the flagship scenario on a deformable body, print the report's path
	$(BIN)/palpate run scenarios/palpate-phantom.toml --out $(OUT)/palpate-phantom
	@echo "Report: $(abspath $(OUT))/palpate-phantom/report.html"

test: .venv/test-installed  ## install the test dependencies, run the tests of Python and C++ but the long ones
	$(PYTEST) --junit-xml=build/junit.xml --ignore=tests/docs $(addprefix --ignore=,$(BUILD_TESTS))

sanitize: .venv/test-installed  ## run all of the core's tests under the address and undefined-behavior sanitizers
	PALPATE_NIGHTLY=1 $(PYTEST) tests/core/test_core_cpp.py

builds: .venv/cross-installed  ## compile the core and the examples as users do: installed, by other compilers, for other machines
	$(PYTEST) $(BUILD_TESTS)

check: lint .venv/test-installed  ## format, lint, types, import graph and fast tests: two minutes after installation
	$(PYTEST) $(FAST_TESTS)

reproduce: .venv/installed  ## compute the thesis, and compare its numbers and conclusions
	$(BIN)/python -m experiments.hosseini2004 --out $(OUT)

bench: .venv/test-installed  ## measure the speed of this machine
	$(BIN)/python -m benchmarks

fuzz: .venv/test-installed  ## read mutated files with every reader for ten minutes; failing files are kept in build/fuzz
	$(BIN)/python tests/support/fuzz.py --count 1000000 --seconds 600 --out build/fuzz

corefuzz: .venv/test-installed  ## fuzz the C++ readers and the tick for ten minutes with libFuzzer; needs clang++, or CLANG=name
	$(BIN)/cmake -S . -B build/corefuzz -G Ninja -DCMAKE_MAKE_PROGRAM=$(CURDIR)/$(BIN)/ninja -DPALPATE_FUZZ=ON \
		-DCMAKE_CXX_COMPILER=$(CLANG) -DPython_EXECUTABLE=$(CURDIR)/$(BIN)/python
	$(BIN)/ninja -C build/corefuzz palpate_fuzz
	mkdir -p build/corefuzz/seeds build/corefuzz/corpus
	PALPATE_FUZZ_SEEDS=build/corefuzz/seeds build/corefuzz/core/tests/fuzz/palpate_fuzz -runs=0
	build/corefuzz/core/tests/fuzz/palpate_fuzz -max_total_time=600 -max_len=65536 -timeout=20 -artifact_prefix=build/corefuzz/ \
		build/corefuzz/corpus build/corefuzz/seeds core/tests/fuzz/corpus

mutate: .venv/test-installed  ## change the Python source, then the C++ core, in a copy, and count the changes that tests notice
	OPENBLAS_NUM_THREADS=1 $(BIN)/python tests/support/mutate.py
	OPENBLAS_NUM_THREADS=1 $(BIN)/python tests/support/core_mutate.py --jobs $(JOBS)

nightly: .venv/cross-installed  ## long studies: random tests with ten times the rounds, slow tests, fuzz, corefuzz, reproduce, bench
	PALPATE_ROUNDS=10 PALPATE_NIGHTLY=1 $(PYTEST)
	$(MAKE) fuzz corefuzz reproduce bench

docs: .venv/docs-installed  ## build the documentation, then run its code blocks
	$(BIN)/python -m sphinx -q -W --keep-going docs docs/_build
	$(BIN)/python docs/notebooks.py docs/_build/notebooks
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n $(JOBS) tests/docs

wheel: .venv/bin/python  ## build a wheel in dist/ and test it in a fresh virtual environment
	rm -rf dist
	$(BIN)/python -m pip wheel --quiet --no-deps --wheel-dir dist .
	rm -rf build/wheel-venv
	$(PYTHON) -m venv build/wheel-venv
	build/wheel-venv/bin/python -m pip install --quiet dist/*.whl
	cd build && wheel-venv/bin/python ../tests/support/wheel_smoke_test.py

lint: .venv/lint-installed  ## check format, style and types
	$(BIN)/ruff check $(PYTHON_FOLDERS)
	$(BIN)/ruff format --check $(PYTHON_FOLDERS)
	$(BIN)/mypy
	$(BIN)/clang-format --dry-run --Werror $(CPP_FILES)

tidy: .venv/lint-installed  ## analyze the C++ core with clang-tidy
	$(BIN)/cmake -S . -B build/tidy -G Ninja -DCMAKE_MAKE_PROGRAM=$(CURDIR)/$(BIN)/ninja -DPALPATE_TESTS=ON -DPython_EXECUTABLE=$(CURDIR)/$(BIN)/python >/dev/null
	$(BIN)/clang-tidy --quiet -p build/tidy core/tests/support/every_header.cpp

format: .venv/lint-installed  ## format Python and C++
	$(BIN)/ruff check --fix $(PYTHON_FOLDERS)
	$(BIN)/ruff format $(PYTHON_FOLDERS)
	$(BIN)/clang-format -i $(CPP_FILES)

clean:  ## remove everything that the other targets make
	rm -rf .venv build dist results docs/_build

.venv/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || \
		{ echo "palpate needs Python 3.11 or newer; set PYTHON=/path/to/it" >&2; exit 1; }
	$(PYTHON) -m venv .venv

# Install the packages of lists in pyproject.toml, without palpate itself: '.[test]' would build the core once more.
packages = $(BIN)/python -c "import tomllib; p = tomllib.load(open('pyproject.toml', 'rb'))['project']; print(*$(1), sep='\n')" \
	| $(BIN)/python -m pip install --quiet --requirement /dev/stdin
extra = $(call packages,p['optional-dependencies']['$(1)'])
# The packages that the goals need are installed while the core compiles.
early = $(if $(filter $(2),$(MAKECMDGOALS)),+ p['optional-dependencies']['$(1)'])
EARLY := $(call early,test,test sanitize builds check nightly docs lint tidy format bench .venv/%-installed) \
	$(call early,lint,check lint tidy format .venv/lint-installed) $(call early,docs,docs .venv/docs-installed)

# Editable: Python changes need no reinstall, and the core is rebuilt when one of its files is newer.
# The core compiles while pip downloads and installs the dependencies.
.venv/installed: .venv/bin/python $(CORE)
	@echo "Compiling the core and installing packages: about three minutes on two cores."
	$(BIN)/python -m pip install --quiet --no-deps --editable . & core=$$!; \
		$(call packages,p['dependencies'] $(EARLY)); packages=$$?; wait $$core && exit $$packages
	@touch $@

.venv/test-installed: .venv/installed
	$(call extra,test)
	@touch $@

.venv/lint-installed: .venv/test-installed
	$(call extra,lint)
	@touch $@

.venv/docs-installed: .venv/test-installed
	$(call extra,docs)
	@touch $@

# Compilers for other machines: with them, tests/core/test_cross_compile.py runs.
.venv/cross-installed: .venv/test-installed
	$(call extra,cross)
	@touch $@
