"""The tables of a scenario, one file each; `schema` puts them together."""
