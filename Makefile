.PHONY: help setup demo test lint lock bench soak docs wheels clean

# Images for containers often set it; then each of the many processes compiles all modules anew.
unexport PYTHONDONTWRITEBYTECODE

PYTHON ?= python3
run := .venv/bin/python

help: ## show this list
	@sed -n 's/^\([a-z]*\):.*## /\1\t/p' Makefile | expand -t 10

setup: ## make .venv with everything in it; does nothing when it is up to date
	@$(PYTHON) -m grader.machine.bootstrap

demo: setup ## grade the reference solution, then a broken one
	@$(run) -m grader.dev.demo

# With more than three, runs that the others disturb are made again, and all takes longer.
test: lint ## lint, type-check and run every test
	@$(run) -m pytest -q -rs --durations=10 -n 3 --dist loadfile --no-loadscope-reorder

lint: setup ## check style, types, imports between folders and dead code; print the house
	@.venv/bin/ruff check --quiet
	@.venv/bin/ruff format --check --quiet
	@$(run) -m mypy --no-error-summary
	@broken=$$(.venv/bin/lint-imports --no-logo --no-cache) || { echo "$$broken"; exit 1; }
	@.venv/bin/vulture
	@$(run) -m grader.dev.house

lock: setup ## regenerate requirements.lock; UPGRADE=1 to newer versions
	@$(run) -m pip install --quiet "uv>=0.8"
	@.venv/bin/uv pip compile pyproject.toml --all-extras --universal --python-version 3.10 \
		--generate-hashes --no-header --no-emit-index-url --quiet \
		$(if $(UPGRADE),--upgrade) --output-file requirements.lock >/dev/null

bench: setup ## measure rosgrade's own overhead
	@$(run) -m grader.dev.bench

soak: setup ## grade a class of 200 (or N=...) under load (LOAD=30), and look for a grade that changes
	@$(run) -m grader.dev.soak $(if $(N),--students $(N)) $(if $(LOAD),--load $(LOAD))

wheels: setup ## build both wheels in dist/: rosgrade, and the solutions for instructors
	@$(run) -m hatchling build -t wheel
	@cd reference && ../$(run) -m hatchling build -t wheel -d ../dist

docs: setup ## regenerate docs/, and build the site in build/site
	@$(run) -m grader.dev.docs
	@NO_MKDOCS_2_WARNING=1 ROSGRADE_REPOSITORY=$${ROSGRADE_REPOSITORY-$$(git config remote.origin.url | \
		sed -n 's|^git@\([^:]*\):|https://\1/|; s|\.git$$||; /^https:/p')} $(run) -m mkdocs build --strict --quiet

clean: ## remove .venv, caches and reports
	@rm -rf .venv .hypothesis .mypy_cache .pytest_cache .ruff_cache build dist rosgrade-report
	@rm -f rosgrade-bench*.json
	@find grader sim tests -name __pycache__ -prune -exec rm -rf {} +
