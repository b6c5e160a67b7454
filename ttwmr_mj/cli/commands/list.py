"""`ttwmr list`: what is shipped."""

from ttwmr_mj.cli.engine import Subcommand


class List(Subcommand, name="list"):
    """List the shipped scenarios."""

    def __call__(self) -> int:
        import tomllib

        from ttwmr_mj.assets import shipped_scenarios

        for name, path in shipped_scenarios().items():
            print(f"{name:20s} {tomllib.loads(path.read_text()).get('description', '')}")
        return 0
