# Shortcuts; everything here also works without make (see README.md).
.PHONY: run test lint format bench docs clean

run:      ; python3 bootstrap.py run
test:     ; python3 bootstrap.py test
lint:     ; .venv/bin/ruff check . && .venv/bin/ruff format --check . && .venv/bin/mypy && .venv/bin/lint-imports
format:   ; .venv/bin/ruff check --fix . && .venv/bin/ruff format .
docs:     ; .venv/bin/sphinx-build -W --keep-going -q docs build/docs && echo build/docs/index.html
bench:    ; .venv/bin/python benchmarks/loop_overhead.py
clean:    ; rm -rf .venv results build dist docs/gallery .pytest_cache .ruff_cache .mypy_cache
