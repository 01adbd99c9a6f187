"""Filling and pressing of many surfaces, clean and defective."""
