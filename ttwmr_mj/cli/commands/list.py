"""`ttwmr list`: what a scenario can be made of."""

from collections.abc import Mapping

from ttwmr_mj.cli.engine import Subcommand


class List(Subcommand, name="list"):
    """List the shipped scenarios and sweeps, and the kinds of controllers and references."""

    def __call__(self) -> int:
        import tomllib

        from ttwmr_mj.assets import shipped_scenarios
        from ttwmr_mj.controllers.base import CONTROLLERS
        from ttwmr_mj.references.shared.reference import REFERENCES
        from ttwmr_mj.studies.bench.suite import shipped_suites
        from ttwmr_mj.studies.sweep.plan.file import shipped_sweeps

        files = {
            what: {
                name: tomllib.loads(path.read_text(encoding="utf-8")).get("description", "")
                for name, path in paths.items()
            }
            for what, paths in {
                "scenarios": shipped_scenarios(),
                "sweeps": shipped_sweeps(),
                "suites": shipped_suites(),
            }.items()
        }
        kinds = {
            "controller.kind": {kind: cls.summary() for kind, cls in CONTROLLERS.items()},
            "reference.kind": {kind: cls.summary() for kind, cls in REFERENCES.items()},
        }
        width = max(len(name) for entries in files.values() for name in entries)
        for title, entries in {**files, **kinds}.items():
            _print(title, entries, width)
        return 0


def _print(title: str, entries: Mapping[str, str], width: int) -> None:
    print(title)
    for name, text in entries.items():
        print(f"  {name:{width}s}  {text}".rstrip())
    print()
