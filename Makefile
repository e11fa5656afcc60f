# Two commands do everything on a fresh machine with Python >= 3.11: `make demo`, `make test`.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo test test-all test-no-posix lint docs package schemas clean

demo: $(VENV)/runs
	$(BIN)/roadlog demo

test: $(VENV)/installed
	$(BIN)/python -m pytest -n 2 --dist worksteal

test-all: $(VENV)/installed
	$(BIN)/python -m pytest -m "" -n 2 --dist worksteal

# the suite as a system without POSIX has it: no fcntl, no fork, no fchmod, no rights of users
test-no-posix: $(VENV)/installed
	PYTHONPATH=tests $(BIN)/python -m pytest -p support.no_posix -n 2 --dist worksteal

lint: $(VENV)/installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

docs: $(VENV)/installed
	$(BIN)/python -m mkdocs build --strict

# sdist and wheel, and the wheel at work in a venv of its own
package: $(VENV)/installed
	rm -rf dist build
	$(BIN)/python -m build --no-isolation --outdir dist
	$(PYTHON) -m venv build/venv
	build/venv/bin/python -m pip install --quiet dist/*.whl
	build/venv/bin/roadlog doctor
	build/venv/bin/roadlog simulate luo2024-road1 -o build/drive.mcap
	build/venv/bin/roadlog estimate build/drive.mcap -e kmbe
	build/venv/bin/roadlog evaluate build/drive.mcap

schemas:
	$(BIN)/python hatch_build.py

# roadlog alone: the demo need not wait for what only the tests use
$(VENV)/runs: pyproject.toml hatch_build.py $(wildcard schemas/*/*.proto schemas/*/*/*.proto)
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --editable .
	touch $@

$(VENV)/installed: $(VENV)/runs
	$(BIN)/python -m pip install --quiet --editable ".[dev]"
	touch $@

clean:
	rm -rf $(VENV) build dist roadlog/schemas.binpb
