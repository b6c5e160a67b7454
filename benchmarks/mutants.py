"""Does a test notice? Single operators of the numerics, mutated one by one.

Mutants are drawn at random from what cosmic-ray finds; each runs against the tests that execute its
line, fastest first, in a copy of the checkout. A mutant that no test notices in the given time has
survived; whether it is equivalent, or a mere tuning constant, a person says. Run it as

    pip install cosmic-ray pytest-cov
    python benchmarks/mutants.py --count 200 --seed 1

It takes a few seconds a mutant. The last line is JSON.
"""

from __future__ import annotations

import argparse
import json
import random
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parent.parent
MODULES = (
    "dynamics/*.py",
    "controllers/**/*.py",
    "references/**/*.py",
    "results/metrics.py",
    "sensing.py",
    "vision/tracking/*.py",
    "studies/compare/**/*.py",
    "scenario/checks.py",
    "scenario/faults.py",
)
PAIRS = "Add_Sub Sub_Add Mul_Div Div_Mul Pow_Mul BitAnd_BitOr Mod_Add FloorDiv_Div"
COMPARISONS = "Lt_Gt LtE_GtE Gt_Lt GtE_LtE Eq_NotEq NotEq_Eq Is_IsNot IsNot_Is"
LONGEST_STATEMENT = 12  # lines
FEW = 60  # tests that are tried first: nearly every mutant is noticed by one of them
OPERATORS = [
    *(f"core/ReplaceBinaryOperator_{pair}" for pair in PAIRS.split()),
    *(f"core/ReplaceComparisonOperator_{pair}" for pair in COMPARISONS.split()),
    "core/ReplaceUnaryOperator_USub_UAdd",
    "core/ReplaceUnaryOperator_Delete_Not",
    "core/ReplaceUnaryOperator_Delete_Invert",
    "core/ReplaceAndWithOr",
    "core/ReplaceOrWithAnd",
]


class Mutant(NamedTuple):
    """One operator, replaced."""

    path: Path
    operator: str
    occurrence: int
    line: int


class Mapping(NamedTuple):
    """Which tests execute a line of a file, and how long each takes."""

    tests: dict[tuple[str, int], set[str]]
    duration_s: dict[str, float]

    @classmethod
    def measured(cls, folder: Path) -> Mapping:
        """Run the tests once, with coverage by test."""
        import coverage

        (folder / ".coveragerc").write_text("[run]\nsource = ttwmr_mj\n")
        command = [sys.executable, "-m", "pytest", "-q", "-n", "2", "--junitxml=durations.xml"]
        command += ["--cov", "--cov-context=test", "--cov-report=", "-p", "no:cacheprovider"]
        subprocess.run(command, cwd=folder, check=True)
        data = coverage.CoverageData(str(folder / ".coverage"))
        data.read()
        tests: dict[tuple[str, int], set[str]] = {}
        for name in data.measured_files():
            for line, contexts in data.contexts_by_lineno(name).items():
                nodes = {context.rpartition("|")[0] for context in contexts if context}
                tests[str(Path(name).relative_to(folder.resolve())), line] = nodes
        cases = ElementTree.parse(folder / "durations.xml").iter("testcase")
        duration = {
            f"{case.get('classname', '').replace('.', '/')}.py::{case.get('name')}": float(
                case.get("time", 0.0)
            )
            for case in cases
        }
        return cls(tests, duration)

    def of(self, mutant: Mutant, folder: Path) -> list[str]:
        """The tests of a mutant's line, fastest first; a statement may have begun lines before."""
        name = str(mutant.path.relative_to(folder))
        lines = range(mutant.line, max(mutant.line - LONGEST_STATEMENT, 0), -1)
        found = next(
            (self.tests[name, line] for line in lines if self.tests.get((name, line))), set()
        )
        return sorted(found, key=lambda test: self.duration_s.get(test, 0.0))


def mutants(folder: Path) -> Iterator[Mutant]:
    """Every operator of the modules that can be replaced."""
    from cosmic_ray.ast import ast_nodes, get_ast_from_path
    from cosmic_ray.plugins import get_operator

    package = folder / "ttwmr_mj"
    for path in sorted({path for pattern in MODULES for path in package.glob(pattern)}):
        nodes = list(ast_nodes(get_ast_from_path(path)))
        for name in OPERATORS:
            operator = get_operator(name)()
            places = [place for node in nodes for place in operator.mutation_positions(node)]
            for occurrence, ((line, _), _) in enumerate(places):
                yield Mutant(path, name, occurrence, line)


def is_noticed(mutant: Mutant, tests: list[str], folder: Path, limit_s: float) -> bool:
    """Whether one of the tests fails, or hangs, with the mutant in place."""
    import cosmic_ray.plugins
    from cosmic_ray.mutating import use_mutation

    operator = cosmic_ray.plugins.get_operator(mutant.operator)()
    with use_mutation(mutant.path, operator, mutant.occurrence):
        for some in filter(None, (tests[:FEW], tests[FEW:])):
            command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *some]
            try:
                done = subprocess.run(command, cwd=folder, capture_output=True, timeout=limit_s)
            except subprocess.TimeoutExpired:
                return True
            if done.returncode != 0:
                return True
    return False


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100, help="mutants to draw")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--limit-s", type=float, default=240.0, help="for the tests of one mutant")
    parser.add_argument("--most-tests", type=int, default=400, help="of one mutant, fastest first")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary).resolve() / "copy"
        subprocess.run(["git", "clone", "-q", str(ROOT), str(folder)], check=True)
        mapping = Mapping.measured(folder)
        drawn = random.Random(options.seed).sample(list(mutants(folder)), options.count)
        survivors = []
        for number, mutant in enumerate(drawn, start=1):
            tests = mapping.of(mutant, folder)[: options.most_tests]
            noticed = bool(tests) and is_noticed(mutant, tests, folder, options.limit_s)
            where = f"{mutant.path.relative_to(folder)}:{mutant.line}"
            if not noticed:
                text = mutant.path.read_text(encoding="utf-8").splitlines()[mutant.line - 1]
                name = mutant.operator.rpartition("Replace")[2]
                survivors.append(f"{where} {name}: {text.strip()}")
            print(f"{number:4d} {'killed' if noticed else 'SURVIVED':8s} {where}", flush=True)
    print(*survivors, sep="\n")
    killed = options.count - len(survivors)
    print(
        json.dumps(
            {
                "benchmark": "mutants",
                "count": options.count,
                "seed": options.seed,
                "killed": killed,
                "share": round(killed / options.count, 3),
            }
        )
    )


if __name__ == "__main__":
    main()
