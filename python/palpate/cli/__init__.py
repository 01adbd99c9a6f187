"""The command line: `palpate run`, `certify`, `sweep`, `identify` and the other commands."""
