# Two commands do all set-up on a machine with Python 3.11, its venv module, a C compiler and make:
#   make report   runs the single-link stability report
#   make test     checks style, types and imports, and runs the quick tests
#   make sanitize runs tests of the numeric wing with every access to memory checked in the compiled core
#   make slow     runs the other tests: random juries, whole reports, killed processes, pages in a browser
# After changes of C files, make core builds flexlin/_core anew (make test does); make wheel packs what users install, into dist.
# Others need more packages:
#   make peers    compares with Pinocchio, heyoka, daceypy and code compiled by numba
#   make docs     builds the documentation into build/site; runs its pages, warnings are errors
#   make links    asks every link of the documentation that leads to another site (needs the network)
# After changes of dependencies, make lock (with uv) pins them with their hashes: nothing else is ever installed.
PYTHON ?= python3
BIN := .venv/bin
PIP = $(BIN)/python -m pip install --quiet --disable-pip-version-check
STAMP := .venv/installed
CHECKED = tests/test_core.py tests/test_program.py tests/test_simulation_collocation.py $(addprefix tests/periodic/,product transition decoupling many)
CHECKERS = $(foreach name,libasan.so libstdc++.so.6,$(shell $(or $(CC),cc) -print-file-name=$(name)))
export OMP_NUM_THREADS = 1
export OPENBLAS_NUM_THREADS = 1
# What one test process has compiled, the others and the commands that they start read.
export PYTHONDONTWRITEBYTECODE =

.PHONY: report test quick core wheel sanitize slow peers docs links lint lock clean

report: core
	$(BIN)/flexlin report single-link --out out/single-link

test: lint quick

quick: core
	$(BIN)/python -m pytest -n 2 --dist loadgroup -m "not slow and not peers"

slow: core
	$(BIN)/python -m pytest -n 2 --dist loadgroup -m "slow and not peers"

peers: core
	$(PIP) --require-hashes -r requirements/peers.txt
	$(BIN)/python -m pytest -n 2 --dist loadfile -m peers tests/mechanics tests/series tests/studies

docs: core
	$(PIP) --require-hashes -r requirements/docs.txt
	$(BIN)/sphinx-build -b html -W --keep-going -q -j 2 -d build/doctrees docs build/site

links: $(STAMP)
	$(PIP) --require-hashes -r requirements/docs.txt
	$(BIN)/sphinx-build -b linkcheck -q -D nb_execution_mode=off -d build/linktrees docs build/links

core: $(STAMP)
	MAKEFLAGS= $(BIN)/cmake --build build/core

sanitize: core
	$(BIN)/cmake -S . -B build/sanitized -G Ninja -DCMAKE_MAKE_PROGRAM=$(CURDIR)/$(BIN)/ninja -DSANITIZED=ON
	$(BIN)/cmake --build build/sanitized
	FLEXLIN_CORE=sanitized ASAN_OPTIONS=detect_leaks=0 LD_PRELOAD="$(CHECKERS)" $(BIN)/python -m pytest -n 2 -m "not slow" $(CHECKED)

wheel: core
	$(BIN)/python -m hatchling build -t wheel -d dist

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check --quiet .
	$(BIN)/mypy
	$(BIN)/lint-imports

$(STAMP): pyproject.toml requirements/lock.txt
	$(PYTHON) -m venv .venv
	$(PIP) --require-hashes -r requirements/lock.txt
	$(PIP) --no-deps --no-build-isolation --editable .
	touch $@

LOCK = uv pip compile --quiet --universal --python-version 3.11 --no-emit-index-url --no-annotate --generate-hashes pyproject.toml

lock:
	$(LOCK) --extra dev -o requirements/lock.txt
	$(LOCK) -c requirements/lock.txt -o requirements/run.txt
	$(LOCK) --extra dev --extra peers -c requirements/lock.txt -o requirements/peers.txt
	$(LOCK) --extra docs --extra cluster -c requirements/lock.txt -o requirements/docs.txt

clean:
	rm -rf .venv build dist out flexlin/_core/built
