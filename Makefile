# make compare [CASE=5] [ARGS="--listing corrected"], make test, make test-all, make quick, make wheel,
# make edition [OUT=DIR]: all set up what they need.
# PYTHON= and FC= choose the interpreter and the Fortran compiler; INSTALL=no forbids apt, dnf, brew.

PYTHON ?= python3
ifeq ($(origin FC),default)
FC := gfortran
endif
INSTALL ?= yes
export INSTALL
# Otherwise every process compiles all sources again, tests with their assertions above all.
export PYTHONDONTWRITEBYTECODE :=
CASE ?= 3
ARGS ?=
OUT ?= build/edition

BIN := .venv/bin
PIP = $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile
FORTRAN := $(wildcard fortran/*.f90 fortran/*/*.f90)
# What fypp wrote: the tools for Fortran do not read its input.
WRITTEN := build/cp*/*_binary*.f90 build/cp*/words.f90
SCRIPTS := $(shell grep -sl '^\#!/bin/sh' .ci/*) .ci/packages verify-port/verify-port.sh \
  $(wildcard docs/how-to/cluster/*.sh)
WORKFLOWS := $(wildcard .github/workflows/*.yml docs/how-to/port/.github/workflows/*.yml)

.PHONY: compare test test-all test-changed quick mutate cross-check wheel edition lint format clean FORCE

compare: .venv/ready
	@$(BIN)/python -m pyharness compare --case $(CASE) $(ARGS)

test: .venv/ready-to-test
	@$(BIN)/python -m pytest -q -n auto --dist worksteal -m "not campaign" $(ARGS)

test-all: .venv/ready-to-test
	@$(BIN)/python -m pytest -q -n auto --dist worksteal $(ARGS)

# Of the packages that differ from the last commit of which all tests passed.
test-changed: .venv/ready-to-test
	@$(BIN)/python -m tests.changed $(ARGS)

quick: .venv/ready-to-test
	@$(BIN)/python -m tests.quick $(ARGS)

mutate: .venv/ready-to-test
	@$(BIN)/python -m tests.campaigns.mutations $(ARGS)

cross-check: .venv/ready-to-test
	@FC=$(FC) $(BIN)/python -m tests.cross $(ARGS)

wheel:
	@.ci/setup "$(PYTHON)" "$(FC)" wheel
	@ls dist/*.whl

edition: .venv/ready-to-test
	@$(BIN)/python -m pyharness edition --out $(OUT) $(ARGS)

lint: .venv/ready-to-test
	@$(BIN)/ruff format --check --quiet
	@$(BIN)/ruff check --quiet
	@$(BIN)/python -m mypy
	@$(BIN)/python -m tests.style
	@MESONPY_EDITABLE_SKIP=$(wildcard $(CURDIR)/build/cp*) PYTHONPATH=$(CURDIR) \
	  $(BIN)/lint-imports --no-cache --no-logo >build/imports.log || { cat build/imports.log; exit 1; }
	@$(BIN)/ninja --quiet -C build/cp*
	@test -z "$$($(BIN)/fprettify --diff $(FORTRAN))" || { echo "fprettify: make format"; exit 1; }
	@$(BIN)/fprettify --diff $(WRITTEN) >build/written.diff
	@test ! -s build/written.diff || { cat build/written.diff; exit 1; }
	@$(BIN)/fortitude --quiet check fortran $(WRITTEN)
	@$(BIN)/shellcheck -x -P SCRIPTDIR $(SCRIPTS)
	@$(BIN)/jactionlint --shellcheck=$(BIN)/shellcheck $(WORKFLOWS)
	@$(BIN)/zizmor --offline --quiet .github verify-port docs/how-to/port/.github

format: .venv/ready-to-test
	@$(BIN)/ruff format --quiet
	@$(BIN)/ruff check --quiet --fix
	@$(BIN)/fprettify $(FORTRAN)

clean:
	rm -rf .venv build dist

# The environment is made anew when its ingredients change, or other tools are requested.
.venv/ready: pyproject.toml meson.build .ci/setup .venv/tools
	@.ci/setup "$(PYTHON)" "$(FC)"
	@echo "$(PYTHON) $(FC)" > .venv/tools
	@touch $@

.venv/ready-to-test: .venv/ready
	@$(BIN)/uv pip install --quiet --python $(BIN)/python --group test || \
	  { $(PIP) "pip>=25.1" && $(PIP) --group test; }
	@touch $@

.venv/tools: FORCE
	@mkdir -p .venv
	@echo "$(PYTHON) $(FC)" | cmp -s - $@ || echo "$(PYTHON) $(FC)" > $@
