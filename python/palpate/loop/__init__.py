"""What beats: a scenario run by the core, its trace, and what the trace shows."""
