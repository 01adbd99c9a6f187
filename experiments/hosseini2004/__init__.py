"""Hosseini-Zadeh's thesis (2004), computed with palpate and compared with its printed numbers."""
