"""`ttwmr list`: what a scenario can be made of."""

from collections.abc import Mapping

from ttwmr_mj.cli.engine import Subcommand


class List(Subcommand, name="list"):
    """List the shipped scenarios, and the kinds of controllers and references."""

    def __call__(self) -> int:
        import tomllib

        from ttwmr_mj.assets import shipped_scenarios
        from ttwmr_mj.controllers.base import CONTROLLERS
        from ttwmr_mj.references.shared.reference import REFERENCES

        scenarios = {
            name: tomllib.loads(path.read_text(encoding="utf-8")).get("description", "")
            for name, path in shipped_scenarios().items()
        }
        kinds = {
            "controller.kind": {kind: cls.summary() for kind, cls in CONTROLLERS.items()},
            "reference.kind": {kind: cls.summary() for kind, cls in REFERENCES.items()},
        }
        width = max(map(len, scenarios))
        for title, entries in {"scenarios": scenarios, **kinds}.items():
            _print(title, entries, width)
        return 0


def _print(title: str, entries: Mapping[str, str], width: int) -> None:
    print(title)
    for name, text in entries.items():
        print(f"  {name:{width}s}  {text}".rstrip())
    print()
