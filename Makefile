# make demo | test | soak | bench | lint | docs | screenshots | hardware | wheels | wheel-simulator: each does the set-up
# it needs, and is quick the second time.

UV_VERSION := 0.13.9
UV  := $(or $(shell command -v uv 2>/dev/null),.tools/bin/uv)
BIN := .venv/bin
export PATH := $(CURDIR)/$(BIN):$(PATH)
# Tests run side by side: threads of linear algebra that wait for one another cost some of them twenty times their work.
test soak: export OPENBLAS_NUM_THREADS := 1
# Else each process compiles all its modules again: a command that starts takes four times the processor's time.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test soak bench lint lint-types lint-python lint-firmware docs docs-pages screenshots hardware wheels \
  wheel-simulator setup setup-demo packages-run packages-test firmware firmware-demo kernels clean

demo: packages-run setup-demo firmware-demo
	@python deploy/demo/run.py

test: packages-test setup firmware kernels
	cd firmware/simulator && sh ../../deploy/cargo.sh test --release --quiet
	sh tests/twice.sh --numprocesses 5 --dist loadfile --no-loadscope-reorder --maxfail 15  # each may wait for minutes

# These keep up with the clock, so each has the machine to itself; the others run in simulated time, the tests of a file
# in one process, which maps its rooms once for all of them.
BY_THE_CLOCK := tests/system/test_fleet.py tests/viewer/test_browser.py

soak: packages-test setup firmware kernels
	pytest -m soak --timeout 1800 --numprocesses 3 --dist loadfile --no-loadscope-reorder --durations 15 $(addprefix --ignore ,$(BY_THE_CLOCK))
	pytest -m soak --timeout 1800 $(BY_THE_CLOCK)

bench: packages-test setup firmware
	-@sh deploy/packages.sh bench
	PYTHONPATH=tests python tests/bench/run.py

lint: packages-test setup firmware
	$(MAKE) --no-print-directory --jobs 2 --output-sync lint-types lint-python lint-firmware docs-pages

lint-types:
	pyright

lint-python:
	ruff check
	ruff format --check
	sh sdk/check_generated.sh

lint-firmware:
	$(MAKE) --no-print-directory -C firmware check
	cd sdk/examples/watch_any && sh ../../../deploy/cargo.sh fmt --check
	cd firmware/simulator && sh ../../deploy/cargo.sh fmt --check && sh ../../deploy/cargo.sh clippy --quiet --all-targets -- --deny warnings

# The documentation as pages for a browser, in .site/; a broken link fails.
docs: packages-test setup docs-pages

docs-pages:
	@NO_MKDOCS_2_WARNING=1 mkdocs build --quiet --config-file deploy/docs/mkdocs.yml
	@echo "Open .site/index.html"

# What the hosts of a fleet install, in dist/, with the versions of all that it needs.
WHEELS := noctule noctule-gateway noctule-mapper noctule-viewer noctule-deploy
wheels: $(UV)
	@rm -f dist/*.whl
	@for package in $(WHEELS); do $(UV) build --quiet --wheel --package $$package --out-dir dist || exit 1; done
	@$(UV) export --quiet --locked --no-dev --all-packages --no-emit-workspace --no-hashes --output-file dist/constraints.txt
	@ls dist

# For machines without Rust: `make demo` takes it from this folder, as long as the simulator's sources are these. It runs
# where glibc is as new as here, or newer.
wheel-simulator: $(UV)
	@sh deploy/wheel_simulator.sh $(UV) $(or $(SIMULATOR_WHEELS),dist/simulator)

# The pictures of the pages, made again.
screenshots: packages-test setup firmware
	PYTHONPATH=tests python tests/viewer/screenshots.py

# The drawings of the hardware pages, made again.
hardware: setup
	@python firmware/hardware/drawings/draw.py

# For deploy/simulator.sh: what was asked for, and whether it runs cargo itself.
ASKED := GOAL=$(or $(firstword $(MAKECMDGOALS)),demo) NEEDS_CARGO=$(firstword $(filter test soak lint,$(MAKECMDGOALS)))

packages-run packages-test:
	@$(ASKED) sh deploy/packages.sh $(@:packages-%=%)

# The demo needs a third of what the tests need; what is there already stays.
setup-demo: SYNC := --inexact --no-default-groups --group demo
setup-demo: export SIZE := 390 MB

# The lock file decides every version; the simulator is built again when its sources change.
setup setup-demo: $(UV)
	@$(ASKED) sh deploy/sync.sh $(UV) $(SYNC)

firmware: setup
firmware-demo: setup-demo
firmware firmware-demo:
	@$(MAKE) --silent --question -C firmware 2>/dev/null || \
	  sh deploy/step.sh firmware "Compiling the firmware: some 10 s" $(MAKE) --no-print-directory -C firmware

# The grid's functions, compiled once: else each of the tests' processes does it for itself.
kernels: setup
	@python -c "import noctule_mapper.grid.kernels"

.tools/bin/uv:
	@echo "Fetching uv, which fetches the packages (25 MB)"
	@python3 -m venv .tools
	@.tools/bin/pip install --quiet --disable-pip-version-check uv==$(UV_VERSION)

clean:
	rm -rf .venv .tools .demo .site dist firmware/build firmware/simulator/target sdk/examples/watch_any/target
