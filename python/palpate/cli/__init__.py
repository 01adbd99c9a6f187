"""The command line: `palpate reproduce`, `run`, `identify`, `devices`, `bench`."""
