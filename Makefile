# make demo: attack loop closure detection on the embedded tour; report in results/latest
# make paper: the paper's experiments over the sequences in DATA; report in results/paper
# make rings: attacks beside defences, and posters, on the sequences of RINGS; page in results/rings
# make target: the detectors before any attack, on the sequences in DATA; tables in results/target
# make test, make lint, make bench, make clean
# make soak: an hour of faults (ARGS='--only messages'); docs/reliability.md tells what came of it
# make lock, make licences: renew requirements/ and docs/licences.md
# make help: these lines
#
# The first target sets up .venv (releases and digests: requirements/; 1.6 GB on disk); after
# that nothing is downloaded or built.
# ARGS are passed on: make demo ARGS='--ratio 1e-4'; make test ARGS='-k codec'

PYTHON ?= python3
ARGS ?=
DATA ?= ../shared/data
PAPER ?= flat_tour office_tour bookstore_tour 7scenes_redkitchen rgbd_dataset_freiburg1_rpy \
  rgbd_dataset_freiburg3_long_office_household
RINGS ?= flat_tour 7scenes_redkitchen office_tour
MODELS ?= adversarial_lcd_ros/models
TRAIN ?= flat_train
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed
BENCHABLE := $(VENV)/.benchable
COMPILED := $(VENV)/.compiled
NODES := attacker bag_replay graph_builder lcd map_builder viewer
PIP := $(BIN)/python -m pip --disable-pip-version-check -qq
# Every release by its digest, from a lock that is complete. What comes as source is built by the
# setuptools of the lock, too.
LOCKED := $(PIP) install --no-deps --require-hashes --no-build-isolation -r

# Inherited from a Python with PyPI's ROS wheels, this would keep ours from finding their own.
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE

.PHONY: help demo paper rings target test lint bench soak lock licences clean setup model
.DEFAULT_GOAL := demo

# $(call there,TARGET,VARIABLE): whether the sequences that a variable names lie in DATA.
there = for sequence in $($(2)); do test -e "$(DATA)/$${sequence%@*}" || { echo "error: there is \
  no $(DATA)/$${sequence%@*}; make $(1) DATA=FOLDER, or $(2)='NAME ...' for others" >&2; exit 1; }; done

help:
	@sed -n '/^#/!q;s/^# \{0,1\}//p' $(firstword $(MAKEFILE_LIST))

demo: model
	$(BIN)/adversarial-lcd demo $(ARGS)

# The models that ship have seen half of freiburg1_rpy, and the report says so. With another folder
# as MODELS detectors are trained there first, on TRAIN alone:
#   make paper MODELS=results/flat_train_models ARGS='--output results/paper_flat_train'
paper: model $(MODELS)/MODEL_CARD.json
	@$(call there,paper,PAPER)
	$(BIN)/adversarial-lcd evaluate $(PAPER:%=$(DATA)/%) --recipe paper \
	  --models $(MODELS) --output results/paper $(ARGS)

$(MODELS)/MODEL_CARD.json: | model
	$(BIN)/adversarial-lcd train $(TRAIN:%=$(DATA)/%) --output $(@D)

rings: model
	@$(call there,rings,RINGS)
	$(BIN)/adversarial-lcd evaluate $(RINGS:%=$(DATA)/%) --recipe rings --output results/rings $(ARGS)

target: model
	$(BIN)/adversarial-lcd targets --recipe target --data $(DATA) --output results/target $(ARGS)

test: model
	$(BIN)/python -m pytest -n 2 $(ARGS)

lint: $(INSTALLED)
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: model $(BENCHABLE)
	$(BIN)/python -m pytest benchmarks $(ARGS)

soak: model
	$(BIN)/python -m soak $(ARGS)

# make lock ARGS=--upgrade takes the newest releases; without it, what setup.cfg asks for anew.
lock: $(INSTALLED)
	@$(LOCKED) requirements/uv.txt
	@PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/python requirements/lock.py $(ARGS)

licences: $(BENCHABLE)
	$(BIN)/python requirements/licences.py > docs/licences.md

setup: model

model: $(INSTALLED) $(COMPILED)
	@$(BIN)/adversarial-lcd fetch-model >/dev/null

# What changes no compiled function is loaded again at once.
$(COMPILED): $(INSTALLED)
	@echo 'compiling (half a minute, once)'
	@$(BIN)/adversarial-lcd compile >/dev/null
	@touch $@

# With ROS 2 sourced its own rclpy is used; otherwise PyPI's wheels of ROS 2 Jazzy are.
# The links are what "pip install ." and colcon make: executables where "ros2 run" looks.
$(INSTALLED): setup.py setup.cfg pyproject.toml requirements/test.txt requirements/ros.txt \
    requirements/part.py
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' || \
	  { echo 'error: $(PYTHON) is older than Python 3.10; make PYTHON=python3.12' >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || \
	  { echo 'error: $(PYTHON) has no venv; on Debian and Ubuntu: sudo apt install python3-venv' >&2; exit 1; }
	@echo 'setting up $(VENV) (some minutes, once)'
	@rm -rf $(VENV)
	@if $(PYTHON) -c 'import rclpy' 2>/dev/null; then \
	  $(PYTHON) -m venv --system-site-packages $(VENV); else $(PYTHON) -m venv $(VENV); fi
	@$(BIN)/python requirements/part.py requirements/test.txt setuptools > $(VENV)/build.txt
	@$(LOCKED) $(VENV)/build.txt
	@lock=test; $(BIN)/python -c 'import rclpy' 2>/dev/null || lock=ros; \
	  $(LOCKED) requirements/$$lock.txt
	@$(PIP) install --no-deps --no-build-isolation -e .
	@mkdir -p $(VENV)/lib/adversarial_lcd_ros
	@for name in adversarial-lcd $(NODES); do \
	  ln -sf ../../bin/$$name $(VENV)/lib/adversarial_lcd_ros/$$name; done
	@touch $@

$(BENCHABLE): $(INSTALLED) requirements/bench.txt
	@$(LOCKED) requirements/bench.txt
	@touch $@

clean:
	rm -rf $(VENV) build dist install log *.egg-info .mypy_cache .pytest_cache .ruff_cache \
	  .hypothesis .benchmarks .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
