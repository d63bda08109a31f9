# Everything a developer types. Each command sets up what it needs; a second call starts at once.
#
#   make run      plan and fly the demonstration manoeuvre      make test    all tests
#   make bench    solve times beside the peers'                 make lint    linters, types, imports
#   make figures  the paper's figures and table                 make soak    the long tests
#   make docs     the documentation's site, offline             make picture the README's moving picture
#   make clean    remove what the build and the tests left      make setup   only the set-up
#   make surveys  the tests of the extras for surveys           (an environment of its own)
#   make sky      the tests of the sky, beside a second library (an environment of its own)
#   make basilisk published manoeuvres flown by Basilisk, and beside its own planner
#
# ARGS="..." is passed on: make test ARGS="-k certificate", make run ARGS="--help".

SHELL := /bin/bash
PYTHON ?= python3
VENV := .venv
PY := $(VENV)/bin/python
ARGS ?=

# The ROS that is sourced, if one is; else ROS 2 Jazzy comes from PyPI into the environment.
SOURCED := $(if $(ROS_DISTRO),ros-$(ROS_DISTRO),pypi)
KEY := $(SOURCED)-$(shell cat requirements.txt requirements-test.txt setup.py package.xml \
	Makefile | cksum | cut -d' ' -f1)
READY := $(VENV)/.ready-$(KEY)

# The site's builder, in the same environment: the reference comes from the code itself.
DOCS_READY := $(VENV)/.docs-$(KEY)-$(shell cksum < requirements-docs.txt | cut -d' ' -f1)

# Basilisk bounds the versions of its dependencies otherwise than we do; it needs no ROS.
BASILISK := .venv-basilisk
BASILISK_READY := $(BASILISK)/.ready-$(shell cksum < requirements-basilisk.txt | cut -d' ' -f1)

# What surveys add (Dask, Arrow, SPICE) and their peers; it needs no ROS.
SURVEYS := .venv-surveys
SURVEYS_READY := $(SURVEYS)/.ready-$(shell cksum < requirements-surveys.txt | cut -d' ' -f1)

# The ephemeris of the sky, and the library that it is compared with; it needs no ROS.
SKY := .venv-sky
SKY_READY := $(SKY)/.ready-$(shell cksum < requirements-sky.txt | cut -d' ' -f1)

# Fuzzing needs a library that is built for few versions of Python.
FUZZ := .venv-fuzz
FUZZ_READY := $(FUZZ)/.ready-$(shell cksum < requirements-fuzz.txt | cut -d' ' -f1)

# Nothing leaves this machine. The wheels of PyPI don't announce where they are installed.
export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST
export ROS_DOMAIN_ID ?= $(shell echo $$(($$PPID % 101 + 1)))
export ROS_PYTHON_CHECK_FIELDS ?= 1
export ROS_LOG_DIR ?= $(CURDIR)/log/ros
export AMENT_PREFIX_PATH := $(CURDIR)/$(VENV)$(if $(AMENT_PREFIX_PATH),:$(AMENT_PREFIX_PATH))

.PHONY: trust sbom dossier mutation fuzz run test bench surveys sky basilisk lint figures soak clean setup docs picture
.DEFAULT_GOAL := run

# In a terminal the demonstration gets Ctrl-C for itself, so that its exit code is make's.
run: $(READY)
	@if [ -t 0 ]; then set -m; fi; $(PY) -m riem_planner.demo.demo $(ARGS); exit $$?

test: $(READY)
	@$(PY) -m pytest -q $(ARGS)

soak: $(READY)
	@$(PY) -m pytest -q -m soak -o faulthandler_timeout=0 $(ARGS)

bench: $(READY)
	@$(PY) -m benchmark $(ARGS)

basilisk: $(BASILISK_READY)
	@PYTHONPATH=$(CURDIR) $(BASILISK)/bin/python -m benchmark.basilisk $(ARGS)

surveys: $(SURVEYS_READY)
	@PYTHONPATH=$(CURDIR) $(SURVEYS)/bin/python -m pytest -q -m extras test/surveys $(ARGS)

sky: $(SKY_READY)
	@PYTHONPATH=$(CURDIR) $(SKY)/bin/python -m pytest -q -m sky test/sky $(ARGS)

figures: $(READY)
	@$(PY) -m riem_planner.paper.figures $(ARGS)

lint: $(READY)
	@$(PY) -m ruff check .
	@$(PY) -m ruff format --check .
	@$(PY) -m mypy
	@$(VENV)/bin/lint-imports --no-logo --no-cache
	@$(PY) docs/check_python.py

docs: $(DOCS_READY)
	@$(PY) -m sphinx -q -W --keep-going -b html docs docs/_build/html
	@echo "docs/_build/html/index.html"

# Needs Chromium: the picture is taken of the plan page.
picture: $(READY)
	@$(PY) -m riem_planner.riem_plan.command config/problems/bevo2_case2.yaml \
		--output plan.json --html page.html
	@$(PY) docs/moving_picture.py page.html docs/pictures/slew.gif

trust: $(READY)
	@$(PY) -m trust.matrix $(ARGS)

sbom: $(READY)
	@mkdir -p build
	@$(PY) -m trust.sbom build/sbom.json && echo build/sbom.json

dossier: $(READY)
	@mkdir -p build
	@$(PY) -m trust.matrix
	@$(PY) -m trust.dossier build/dossier.zip && echo build/dossier.zip

# A sample of the mutants of the checker, by default; FILE, TESTS and ARGS choose others, and more.
FILE ?= riem_planner/proof/check.py
TESTS ?= --test test/proof/test_check.py
mutation: $(READY)
	@mkdir -p build
	@$(PY) -m trust.mutation $(FILE) $(TESTS) --most 100 $(ARGS) | tee build/mutation.txt

fuzz: $(FUZZ_READY)
	@for reader in problem plan proof; do \
		$(FUZZ)/bin/python -m trust.fuzz $$reader -max_total_time=60 $(ARGS) || exit 1; done

setup: $(READY)
	@echo "$(VENV) is ready"

$(READY):
	@echo "setting up $(VENV) ($(SOURCED)), once; this takes about a minute"
	@if [ "$$(cat $(VENV)/.kind 2>/dev/null || echo $(SOURCED))" != "$(SOURCED)" ]; then \
		rm -rf $(VENV); fi
	@[ -x $(PY) ] || $(PYTHON) -m venv $(if $(ROS_DISTRO),--system-site-packages) $(VENV)
	@echo $(SOURCED) > $(VENV)/.kind
ifdef ROS_DISTRO
	@$(PY) -m pip install --quiet --disable-pip-version-check --editable '.[test]'
	@$(PY) -m pip install --quiet --disable-pip-version-check ruff mypy types-PyYAML
else
	@$(PY) -m pip install --quiet --disable-pip-version-check -r requirements-test.txt
	@$(PY) -m pip install --quiet --disable-pip-version-check --no-deps \
		--no-build-isolation --editable .
endif
	@# An editable installation leaves out the files that ROS looks for: links to them.
	@mkdir -p $(VENV)/share/ament_index/resource_index/packages $(VENV)/share/riem_planner \
		$(VENV)/lib/riem_planner
	@ln -sfn $(CURDIR)/resource/riem_planner \
		$(VENV)/share/ament_index/resource_index/packages/riem_planner
	@ln -sfn $(CURDIR)/package.xml $(VENV)/share/riem_planner/package.xml
	@ln -sfn $(CURDIR)/config $(VENV)/share/riem_planner/config
	@for command in planner_node spacecraft_sim riem_plan riem_timeline riem_campaign riem_export \
		riem_figures riem_check riem_monitor sky_node; do \
		ln -sfn ../../bin/$$command $(VENV)/lib/riem_planner/$$command; done
	@rm -f $(VENV)/.ready-*
	@touch $@

$(DOCS_READY): $(READY)
	@echo "setting up the documentation's builder, once"
	@$(PY) -m pip install --quiet --disable-pip-version-check -r requirements-docs.txt
	@rm -f $(VENV)/.docs-*
	@touch $@

$(FUZZ_READY):
	@echo "setting up $(FUZZ), once"
	@[ -x $(FUZZ)/bin/python ] || $(PYTHON) -m venv $(FUZZ)
	@$(FUZZ)/bin/python -m pip install --quiet --disable-pip-version-check -r requirements-fuzz.txt
	@rm -f $(FUZZ)/.ready-*
	@touch $@

$(BASILISK_READY):
	@echo "setting up $(BASILISK) (Basilisk, 1 GB), once; this takes about a minute"
	@[ -x $(BASILISK)/bin/python ] || $(PYTHON) -m venv $(BASILISK)
	@$(BASILISK)/bin/python -m pip install --quiet --disable-pip-version-check \
		-r requirements-basilisk.txt
	@rm -f $(BASILISK)/.ready-*
	@touch $@

$(SURVEYS_READY):
	@echo "setting up $(SURVEYS) (500 MB), once; this takes about a minute"
	@[ -x $(SURVEYS)/bin/python ] || $(PYTHON) -m venv $(SURVEYS)
	@$(SURVEYS)/bin/python -m pip install --quiet --disable-pip-version-check \
		-r requirements-surveys.txt
	@# All of its dependencies hold CPLEX; its slew models need astropy alone.
	@$(SURVEYS)/bin/python -m pip install --quiet --disable-pip-version-check --no-deps \
		m4opt==2.3.1
	@rm -f $(SURVEYS)/.ready-*
	@touch $@

$(SKY_READY):
	@echo "setting up $(SKY), once; this takes about a minute"
	@[ -x $(SKY)/bin/python ] || $(PYTHON) -m venv $(SKY)
	@$(SKY)/bin/python -m pip install --quiet --disable-pip-version-check -r requirements-sky.txt
	@rm -f $(SKY)/.ready-*
	@touch $@

clean:
	rm -rf build install log figures .pytest_cache .hypothesis .mypy_cache .ruff_cache .benchmarks
	rm -rf *.egg-info plan.json plan.png page.html demo.png demo.html docs/_build
	find . \( -path ./$(VENV) -o -path ./$(BASILISK) -o -path ./$(SURVEYS) \
		-o -path ./$(SKY) \) -prune \
		-o -name __pycache__ -type d -print0 | xargs -0 rm -rf
