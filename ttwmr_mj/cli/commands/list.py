"""`ttwmr list`: what is shipped."""

from ttwmr_mj.cli.engine import Subcommand


class List(Subcommand, name="list"):
    """List the shipped scenarios."""

    def __call__(self) -> int:
        import tomllib

        from ttwmr_mj.assets import shipped_scenarios

        shipped = shipped_scenarios()
        width = max(map(len, shipped))
        for name, path in shipped.items():
            print(f"{name:{width}s}  {tomllib.loads(path.read_text()).get('description', '')}")
        return 0
