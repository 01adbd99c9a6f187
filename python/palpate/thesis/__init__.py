"""The thesis that palpate grew from, computed anew and held against its printed numbers."""
