# Two commands on a fresh machine (Python 3.11+, a C++20 compiler, make): `make reproduce` and `make test`.
# Each makes .venv and installs what it needs from the package index.

PYTHON ?= $(shell for p in python3.13 python3.12 python3.11; do if $$p -c '' 2>/dev/null; then echo $$p; exit; fi; done; echo python3)
BIN := .venv/bin
CORE := CMakeLists.txt pyproject.toml $(shell find core/include python/src cmake -type f)
OUT ?= results
JOBS ?= 2

.PHONY: reproduce test bench lint tidy format clean

reproduce: .venv/installed
	$(BIN)/python -m experiments.hosseini2004 --out $(OUT)

test: .venv/test-installed
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder

bench: .venv/test-installed
	$(BIN)/python -m benchmarks

lint: .venv/lint-installed
	$(BIN)/ruff check python experiments benchmarks tests examples
	$(BIN)/ruff format --check python experiments benchmarks tests examples
	$(BIN)/mypy
	$(BIN)/clang-format --dry-run --Werror $$(find core python/src -name '*.hpp' -o -name '*.cpp')

tidy: .venv/lint-installed
	$(BIN)/cmake -S . -B build/tidy -G Ninja -DCMAKE_MAKE_PROGRAM=$(CURDIR)/$(BIN)/ninja -DPALPATE_TESTS=ON -DPython_EXECUTABLE=$(CURDIR)/$(BIN)/python >/dev/null
	$(BIN)/clang-tidy --quiet -p build/tidy core/tests/simulation_test.cpp  # includes and instantiates every header

format: .venv/lint-installed
	$(BIN)/ruff check --fix python experiments benchmarks tests examples
	$(BIN)/ruff format python experiments benchmarks tests examples
	$(BIN)/clang-format -i $$(find core python/src -name '*.hpp' -o -name '*.cpp')

clean:
	rm -rf .venv build results

.venv/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || \
		{ echo "palpate needs Python 3.11 or newer; set PYTHON=/path/to/it" >&2; exit 1; }
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --upgrade pip

# Editable: Python changes need no reinstall, and the core is rebuilt when one of its files is newer.
.venv/installed: .venv/bin/python $(CORE)
	$(BIN)/python -m pip install --quiet --editable .
	@touch $@

# The extras' own packages only: asking for '.[test]' would build the core once more.
extra = $(BIN)/python -c "import tomllib; print(*tomllib.load(open('pyproject.toml', 'rb'))['project']['optional-dependencies']['$(1)'], sep='\n')" \
	| $(BIN)/python -m pip install --quiet --requirement /dev/stdin

.venv/test-installed: .venv/installed
	$(call extra,test)
	@touch $@

.venv/lint-installed: .venv/test-installed
	$(call extra,lint)
	@touch $@
