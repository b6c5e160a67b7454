"""The limits of all rules: the table `limits` of claims.toml, fixed before any run."""

from ttwmr_mj.studies.reproduce.words import read_toml

_TABLE = read_toml(__package__, "claims.toml")["limits"]
LIMITS: dict[str, float] = {name: entry["value"] for name, entry in _TABLE.items()}
REASONS: dict[str, str] = {name: entry["why"] for name, entry in _TABLE.items()}
